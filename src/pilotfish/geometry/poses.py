"""Poses: position and orientation of a body."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry.quaternions import conjugate, multiply, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, shorten_repr

NORM_TOLERANCE = 1e-4  # allows four typed digits: |(.7071, .7071, 0, 0)| = 1 - 1e-5


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Rigid transform; as world_from_a it maps coordinates in frame a to coordinates in the world.

    Names cancel where poses meet: world_from_a @ a_from_b = world_from_b.

    Attributes:
        position: Origin [m].
        quaternion: Unit quaternion w x y z.
    """

    position: Float[Array, " 3"]
    quaternion: Float[Array, " 4"]

    def __matmul__(self, other: "Pose") -> "Pose":
        position = self.position + rotation_matrix(self.quaternion) @ other.position
        return Pose(position, multiply(self.quaternion, other.quaternion))

    def inverse(self) -> "Pose":
        """Return a_from_world for world_from_a."""
        inverse_quaternion = conjugate(self.quaternion)
        return Pose(-rotation_matrix(inverse_quaternion) @ self.position, inverse_quaternion)


def pose(position: object, quaternion: object) -> Pose:
    """Return a validated pose.

    Args:
        position: Three coordinates [m].
        quaternion: Unit quaternion w x y z; a norm within 1e-4 of one is rounding and is divided out.

    Raises:
        InvalidInput: If a value is not finite or has another shape, or the norm differs from one.
    """
    position_array, quaternion_array = (
        finite_array(position, "position", (3,)),
        finite_array(quaternion, "quaternion", (4,)),
    )
    norm = float(np.linalg.norm(quaternion_array))
    if abs(norm - 1) > NORM_TOLERANCE:
        raise InvalidInput(
            f"quaternion {quaternion_array.tolist()} has norm {norm:.6g}, expected 1 within "
            f"{NORM_TOLERANCE:g}; "
            "pass geometry.normalise(quaternion)"
        )
    return Pose(position_array, quaternion_array / norm)
