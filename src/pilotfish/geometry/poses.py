"""Poses: where a body is and how it is turned."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry.quaternions import conjugate, multiply, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array

NORM_TOLERANCE = 1e-4  # what four typed digits leave: |(.7071, .7071, 0, 0)| = 1 - 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A place [m] and a unit quaternion; as world_from_a it takes what a sees to what the world sees.

    Names cancel where poses meet: world_from_a @ a_from_b = world_from_b.
    """

    position: Float[Array, " 3"]
    quaternion: Float[Array, " 4"]

    def __matmul__(self, other: "Pose") -> "Pose":
        position = self.position + rotation_matrix(self.quaternion) @ other.position
        return Pose(position, multiply(self.quaternion, other.quaternion))

    def inverse(self) -> "Pose":
        """a_from_world, given world_from_a."""
        inverse_quaternion = conjugate(self.quaternion)
        return Pose(-rotation_matrix(inverse_quaternion) @ self.position, inverse_quaternion)


def pose(position: object, quaternion: object) -> Pose:
    """The door for poses: three metres and a unit quaternion w x y z, or InvalidInput.

    A norm within 1e-4 of one is rounding and is divided out; further away it is refused.
    """
    position_array, quaternion_array = (
        finite_array(position, "position", (3,)),
        finite_array(quaternion, "quaternion", (4,)),
    )
    norm = float(np.linalg.norm(quaternion_array))
    if abs(norm - 1) > NORM_TOLERANCE:
        raise InvalidInput(
            f"quaternion {quaternion_array.tolist()} has norm {norm:.6g}, expected 1 within {NORM_TOLERANCE:g}; "
            "if only its length is wrong, pass geometry.normalise(quaternion)"
        )
    return Pose(position_array, quaternion_array / norm)
