"""Demonstrations: recordings of a task, the layout of their columns and the frames of its objects.

`demonstration` checks a user's array. `add_derivatives`, `resample`, `to_sphere` and `unwrap_orientations`
convert recordings, `diagnose` finds anomalies, and `views` gives the local data that skills are learned from.
"""

from pilotfish.demonstrations.derivatives import add_derivatives
from pilotfish.demonstrations.diagnostics import Diagnostic, diagnose
from pilotfish.demonstrations.frames import (
    Frame,
    MovingFrame,
    frame,
    moving_frame,
    world_frame,
)
from pilotfish.demonstrations.layouts import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.demonstrations.pose_frames import frame_from_pose, moving_frame_from_poses
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.resampling import resample
from pilotfish.demonstrations.signs import has_opposite_sign, unwrap_orientations
from pilotfish.demonstrations.sphere import to_sphere
from pilotfish.demonstrations.switches import common_switches, switching_columns
from pilotfish.demonstrations.views import Views, views

__all__ = [
    "Demonstration",
    "Diagnostic",
    "Frame",
    "Layout",
    "MovingFrame",
    "Part",
    "Quantity",
    "Views",
    "add_derivatives",
    "common_switches",
    "demonstration",
    "diagnose",
    "frame",
    "frame_from_pose",
    "has_opposite_sign",
    "moving_frame",
    "moving_frame_from_poses",
    "pose_layout",
    "position_layout",
    "resample",
    "switching_columns",
    "to_sphere",
    "unwrap_orientations",
    "views",
    "world_frame",
]
