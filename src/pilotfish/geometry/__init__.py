"""Rotations and poses: quaternions w x y z, rotation vectors, poses, and exponential and logarithmic maps.

Names are short because the package is used by its name: `geometry.multiply(p, q)`.
"""

from pilotfish.geometry.manifold import (
    exp_map,
    exp_map_jacobian,
    karcher_mean,
    log_map,
    log_map_jacobian,
    parallel_transport,
    tangent_slices,
)
from pilotfish.geometry.minimum_jerk import minimum_jerk
from pilotfish.geometry.poses import Pose, pose
from pilotfish.geometry.quaternions import (
    angle,
    conjugate,
    left_multiplication_matrix,
    multiply,
    normalise,
    quaternion_exp,
    quaternion_from_rotation_matrix,
    quaternion_log,
    rotation_matrix,
    unwrap_quaternions,
)
from pilotfish.geometry.rotation_vectors import (
    from_rotation_vector,
    inverse_right_jacobian,
    inverse_right_jacobian_derivative,
    relative_rotation_vector,
    right_jacobian,
    rotation_vector_in_world,
    to_rotation_vector,
)

__all__ = [
    "Pose",
    "angle",
    "conjugate",
    "exp_map",
    "exp_map_jacobian",
    "from_rotation_vector",
    "inverse_right_jacobian",
    "inverse_right_jacobian_derivative",
    "karcher_mean",
    "left_multiplication_matrix",
    "log_map",
    "log_map_jacobian",
    "minimum_jerk",
    "multiply",
    "normalise",
    "parallel_transport",
    "pose",
    "quaternion_exp",
    "quaternion_from_rotation_matrix",
    "quaternion_log",
    "relative_rotation_vector",
    "right_jacobian",
    "rotation_matrix",
    "rotation_vector_in_world",
    "tangent_slices",
    "to_rotation_vector",
    "unwrap_quaternions",
]
