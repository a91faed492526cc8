"""Demonstrations: recordings of a task, the layout of their columns and the frames of its objects.

`demonstration` checks a user's array, and `build_demonstration` converts a recording of a laboratory's file.
`add_derivatives`, `resample`, `to_sphere` and `unwrap_orientations` convert demonstrations, `diagnose` finds
anomalies, and `views` gives the local data that skills are learned from.
"""

from pilotfish.demonstrations.build_settings import BuildSettings, Conversion, FrameSource, PartSource
from pilotfish.demonstrations.building import build_demonstration
from pilotfish.demonstrations.column_selection import column_names, select_columns
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
from pilotfish.demonstrations.pose_frames import frame_from_pose, moving_frame_from_poses, planar_frame
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.reference_frames import to_common_reference_frames
from pilotfish.demonstrations.resampling import resample, resample_to_period
from pilotfish.demonstrations.rotation_conversion import to_quaternions
from pilotfish.demonstrations.signals import Recording, Signal
from pilotfish.demonstrations.signs import has_opposite_sign, unwrap_orientations
from pilotfish.demonstrations.sphere import to_sphere
from pilotfish.demonstrations.suggestions import Question, suggest_settings
from pilotfish.demonstrations.switches import (
    common_switches,
    count_at_limits,
    select_switches,
    switching_columns,
)
from pilotfish.demonstrations.timestamps import time_unit
from pilotfish.demonstrations.units import is_unit, parse_unit
from pilotfish.demonstrations.views import Views, require_compatible, views

__all__ = [
    "BuildSettings",
    "Conversion",
    "Demonstration",
    "Diagnostic",
    "Frame",
    "FrameSource",
    "Layout",
    "MovingFrame",
    "Part",
    "PartSource",
    "Quantity",
    "Question",
    "Recording",
    "Signal",
    "Views",
    "add_derivatives",
    "build_demonstration",
    "column_names",
    "common_switches",
    "count_at_limits",
    "demonstration",
    "diagnose",
    "frame",
    "frame_from_pose",
    "has_opposite_sign",
    "is_unit",
    "moving_frame",
    "moving_frame_from_poses",
    "parse_unit",
    "planar_frame",
    "pose_layout",
    "position_layout",
    "require_compatible",
    "resample",
    "resample_to_period",
    "select_columns",
    "select_switches",
    "suggest_settings",
    "switching_columns",
    "time_unit",
    "to_common_reference_frames",
    "to_quaternions",
    "to_sphere",
    "unwrap_orientations",
    "views",
    "world_frame",
]
