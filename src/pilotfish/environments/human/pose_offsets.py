"""Differences between poses as six numbers.

The first three are the translation in world axes [m]; the others are the rotation from the first pose to the
second as a rotation vector in the axes of the first [rad].
"""

import numpy as np

from pilotfish.geometry import Pose, from_rotation_vector, multiply, relative_rotation_vector
from pilotfish.types import Array, Float


def pose_difference(a: Pose, b: Pose) -> Float[Array, " 6"]:
    """Return the offset from a to b."""
    return np.concatenate([b.position - a.position, relative_rotation_vector(a.quaternion, b.quaternion)])


def add_offset(a: Pose, offset: Float[Array, " 6"]) -> Pose:
    """Return the pose at an offset from a; the inverse of pose_difference."""
    return Pose(a.position + offset[:3], multiply(a.quaternion, from_rotation_vector(offset[3:])))


def offset_norms(offset: Float[Array, " 6"]) -> tuple[float, float]:
    """Return distance [m] and angle [rad] of an offset."""
    return float(np.linalg.norm(offset[:3])), float(np.linalg.norm(offset[3:]))


def clip_offset(offset: Float[Array, " 6"], max_distance: float, max_angle: float) -> Float[Array, " 6"]:
    """Return an offset in the same directions with limited distance [m] and angle [rad]."""
    distance, angle = offset_norms(offset)
    scale = max_distance / distance if distance > max_distance else 1.0
    angular_scale = max_angle / angle if angle > max_angle else 1.0
    return np.concatenate([scale * offset[:3], angular_scale * offset[3:]])
