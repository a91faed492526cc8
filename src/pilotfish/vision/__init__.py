"""Frames of objects from the images of a camera: markers, poses, calibration and sheets to print."""

from pilotfish.vision.calibration import (
    BoardView,
    Calibration,
    CalibrationBoard,
    calibrate_camera,
    find_board,
)
from pilotfish.vision.camera import Camera, project, read_camera, write_camera
from pilotfish.vision.detection import Detections, detect_markers, marker_bitmap
from pilotfish.vision.edge_refinement import refine_corners
from pilotfish.vision.frame_tracker import FrameTracker, Observation, Rejection, TrackerSettings
from pilotfish.vision.frame_tracks import FrameTrack, frame_tracks, write_frames
from pilotfish.vision.image_source import ImageSource, image_files, open_images, read_image
from pilotfish.vision.marker_setup import (
    DEFAULT_DICTIONARY,
    DICTIONARIES,
    Marker,
    MarkerSetup,
    parse_markers,
    read_markers,
)
from pilotfish.vision.marker_sheet import PAPERS, write_marker_sheet
from pilotfish.vision.opencv import require_opencv
from pilotfish.vision.picture import draw_detections, write_picture
from pilotfish.vision.pose_estimation import PoseCandidate, estimate_pose

__all__ = [
    "DEFAULT_DICTIONARY",
    "DICTIONARIES",
    "PAPERS",
    "BoardView",
    "Calibration",
    "CalibrationBoard",
    "Camera",
    "Detections",
    "FrameTrack",
    "FrameTracker",
    "ImageSource",
    "Marker",
    "MarkerSetup",
    "Observation",
    "PoseCandidate",
    "Rejection",
    "TrackerSettings",
    "calibrate_camera",
    "detect_markers",
    "draw_detections",
    "estimate_pose",
    "find_board",
    "frame_tracks",
    "image_files",
    "marker_bitmap",
    "open_images",
    "parse_markers",
    "project",
    "read_camera",
    "read_image",
    "read_markers",
    "refine_corners",
    "require_opencv",
    "write_camera",
    "write_frames",
    "write_marker_sheet",
    "write_picture",
]
