"""Recordings of a task and the frames they are seen from: the one door through which recordings come in
(`demonstration`), its readers for folders and published files, and the views that skills are learned from.
"""

from pilotfish.demonstrations.derivatives import add_derivatives
from pilotfish.demonstrations.diagnostics import Diagnostic, Severity, diagnose
from pilotfish.demonstrations.distances import distance_unit, distances, is_orientation
from pilotfish.demonstrations.frame_validation import frame, moving_frame
from pilotfish.demonstrations.frames import (
    Frame,
    MovingFrame,
    frame_from_pose,
    moving_frame_from_poses,
    require_left_multiplication,
    require_magnitudes,
    tangent_map,
    world_frame,
)
from pilotfish.demonstrations.layouts import (
    Layout,
    Part,
    Quantity,
    pose_layout,
    position_layout,
    require_name,
)
from pilotfish.demonstrations.recording import Demonstration, demonstration, require_period
from pilotfish.demonstrations.resampling import resample
from pilotfish.demonstrations.signs import unwrap_orientations
from pilotfish.demonstrations.sphere import to_sphere
from pilotfish.demonstrations.views import Views, views

__all__ = [
    "Demonstration",
    "Diagnostic",
    "Frame",
    "Layout",
    "MovingFrame",
    "Part",
    "Quantity",
    "Severity",
    "Views",
    "add_derivatives",
    "demonstration",
    "diagnose",
    "distance_unit",
    "distances",
    "frame",
    "frame_from_pose",
    "is_orientation",
    "moving_frame",
    "moving_frame_from_poses",
    "pose_layout",
    "position_layout",
    "require_left_multiplication",
    "require_magnitudes",
    "require_name",
    "require_period",
    "resample",
    "tangent_map",
    "to_sphere",
    "unwrap_orientations",
    "views",
    "world_frame",
]
