"""Recordings of a task and the frames they are seen from: the one door through which recordings come in
(`demonstration`), its readers for folders and published files, and the views that skills are learned from.
"""

from pilotfish.demonstrations.derivatives import with_derivatives
from pilotfish.demonstrations.findings import Finding, Severity, check
from pilotfish.demonstrations.folders import read_folder, require_replaceable, write_folder
from pilotfish.demonstrations.frame_doors import frame, moving_frame
from pilotfish.demonstrations.frame_views import Views, views
from pilotfish.demonstrations.frames import (
    Frame,
    MovingFrame,
    frame_from_pose,
    moving_frame_from_poses,
    require_magnitudes,
    require_turns,
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
from pilotfish.demonstrations.published import read_valve_mat, read_zshape_mat
from pilotfish.demonstrations.published_arrays import read_helloworld_npy, read_robotasks_npy
from pilotfish.demonstrations.published_extracts import (
    read_chicken_dance_npz,
    read_letters_npz,
    read_mocap6_labels_npz,
    read_mocap6_npz,
)
from pilotfish.demonstrations.recording import Demonstration, demonstration, require_period
from pilotfish.demonstrations.resampling import resampled
from pilotfish.demonstrations.signs import continuous_quaternions
from pilotfish.demonstrations.sphere import on_sphere

__all__ = [
    "Demonstration",
    "Finding",
    "Frame",
    "Layout",
    "MovingFrame",
    "Part",
    "Quantity",
    "Severity",
    "Views",
    "check",
    "continuous_quaternions",
    "demonstration",
    "frame",
    "frame_from_pose",
    "moving_frame",
    "moving_frame_from_poses",
    "on_sphere",
    "pose_layout",
    "position_layout",
    "read_chicken_dance_npz",
    "read_folder",
    "read_helloworld_npy",
    "read_letters_npz",
    "read_mocap6_labels_npz",
    "read_mocap6_npz",
    "read_robotasks_npy",
    "read_valve_mat",
    "read_zshape_mat",
    "require_magnitudes",
    "require_name",
    "require_period",
    "require_replaceable",
    "require_turns",
    "resampled",
    "tangent_map",
    "views",
    "with_derivatives",
    "world_frame",
    "write_folder",
]
