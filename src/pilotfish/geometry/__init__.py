"""Rotations and poses: unit quaternions w x y z as rotations and as points of S^3, and poses that compose.
Names are short because the room is used by its name: `geometry.multiply(p, q)`.
"""

from pilotfish.geometry.poses import Pose, pose
from pilotfish.geometry.quaternions import (
    angle,
    conjugate,
    continuous,
    exp,
    from_rotation_matrix,
    left_matrix,
    log,
    multiply,
    normalise,
    rotation_matrix,
)

__all__ = [
    "Pose",
    "angle",
    "conjugate",
    "continuous",
    "exp",
    "from_rotation_matrix",
    "left_matrix",
    "log",
    "multiply",
    "normalise",
    "pose",
    "rotation_matrix",
]
