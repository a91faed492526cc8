"""What lies between two poses, as six numbers: metres in the axes of the world, and the turn from the first
to the second as a rotation vector [rad] in the axes of the first.
"""

import numpy as np

from pilotfish.geometry import Pose, from_rotation_vector, multiply, relative_rotation_vector
from pilotfish.types import Array, Float


def pose_difference(a: Pose, b: Pose) -> Float[Array, " 6"]:
    """The offset that leads from a to b."""
    return np.concatenate([b.position - a.position, relative_rotation_vector(a.quaternion, b.quaternion)])


def add_offset(a: Pose, offset: Float[Array, " 6"]) -> Pose:
    """The pose that lies offset from a: beyond(a, between(a, b)) is b."""
    return Pose(a.position + offset[:3], multiply(a.quaternion, from_rotation_vector(offset[3:])))


def offset_norms(offset: Float[Array, " 6"]) -> tuple[float, float]:
    """How far [m], and how much it turns [rad]."""
    return float(np.linalg.norm(offset[:3])), float(np.linalg.norm(offset[3:]))


def clip_offset(offset: Float[Array, " 6"], far: float, turned: float) -> Float[Array, " 6"]:
    """The offset in the same directions, not longer than far [m] and turned [rad]."""
    distance, angle = offset_norms(offset)
    share = far / distance if distance > far else 1.0
    share_turned = turned / angle if angle > turned else 1.0
    return np.concatenate([share * offset[:3], share_turned * offset[3:]])
