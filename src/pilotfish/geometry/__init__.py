"""Rotations and poses: unit quaternions w x y z as rotations and as points of S^3, poses that compose, and
products of flat space and S^3 with their tangent spaces.
Names are short because the room is used by its name: `geometry.multiply(p, q)`.
"""

from pilotfish.geometry.manifold import (
    differential,
    exp_at,
    inverse_differential,
    karcher_mean,
    log_at,
    tangent_slices,
    transport,
)
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
from pilotfish.geometry.rotation_vectors import (
    cross_matrix,
    inverse_right_jacobian,
    inverse_right_jacobian_change,
    right_jacobian,
    rotation_vector,
)

__all__ = [
    "Pose",
    "angle",
    "conjugate",
    "continuous",
    "cross_matrix",
    "differential",
    "exp",
    "exp_at",
    "from_rotation_matrix",
    "inverse_differential",
    "inverse_right_jacobian",
    "inverse_right_jacobian_change",
    "karcher_mean",
    "left_matrix",
    "log",
    "log_at",
    "multiply",
    "normalise",
    "pose",
    "right_jacobian",
    "rotation_matrix",
    "rotation_vector",
    "tangent_slices",
    "transport",
]
