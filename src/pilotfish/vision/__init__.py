"""Frames of objects from the images of a camera: markers, poses, calibration and sheets to print."""

from pilotfish.vision.camera import Camera, project, read_camera, write_camera
from pilotfish.vision.detection import Detections, detect_markers, marker_bitmap
from pilotfish.vision.frame_tracker import FrameTracker, Observation, Rejection, TrackerSettings
from pilotfish.vision.marker_setup import (
    DEFAULT_DICTIONARY,
    DICTIONARIES,
    Marker,
    MarkerSetup,
    parse_markers,
    read_markers,
)
from pilotfish.vision.opencv import require_opencv
from pilotfish.vision.pose_estimation import PoseCandidate, estimate_pose

__all__ = [
    "DEFAULT_DICTIONARY",
    "DICTIONARIES",
    "Camera",
    "Detections",
    "FrameTracker",
    "Marker",
    "MarkerSetup",
    "Observation",
    "PoseCandidate",
    "Rejection",
    "TrackerSettings",
    "detect_markers",
    "estimate_pose",
    "marker_bitmap",
    "parse_markers",
    "project",
    "read_camera",
    "read_markers",
    "require_opencv",
    "write_camera",
]
