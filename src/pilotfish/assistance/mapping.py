"""Direct control: from the operator's hand to the pose that it commands, with scale, offset and clutch.

    position     p = p_0 + R_0 (scale p_hand) + shift
    orientation  q = q_0 q_hand turn

(p_0, R_0) is the offset, fixed at construction: the pose of the operator's coordinate system in the robot's
world. Shift and turn change with the clutch. While it is open the command holds, and when it closes they are
chosen so that the command continues where it was, however the hand moved in between. The turn stands on the
right, so that rotations of the hand about axes of the world stay rotations about these axes. Scalars such as
a grip pass unchanged while the clutch is closed.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from pilotfish.geometry import Pose, conjugate, multiply, normalise, rotation_matrix
from pilotfish.geometry import pose as validated_pose
from pilotfish.kernels import HandMap, map_hand
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type

MIN_SCALE, MAX_SCALE = 1e-3, 1e3
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def _origin() -> Pose:
    return Pose(np.zeros(3), IDENTITY)


@dataclass(frozen=True, slots=True)
class OperatorMapping:
    """Fixed map from the operator's hand to the robot.

    Attributes:
        scale: Movement of the robot for a unit movement of the hand.
        offset: Pose of the operator's coordinate system in the robot's world.

    Raises:
        InvalidInput: If the scale is not from 1e-3 to 1e3, or the offset is not a pose.
    """

    scale: float = 1.0
    offset: Pose = field(default_factory=_origin)

    def __post_init__(self) -> None:
        require_number(self.scale, "scale", MIN_SCALE, MAX_SCALE)
        require_type(self.offset, "offset", Pose, "pf.geometry.pose(position, quaternion) makes one")
        validated_pose(self.offset.position, self.offset.quaternion)


def open_map(mapping: OperatorMapping) -> HandMap:
    """Return the map of a clutch that has collected no displacement.

    Args:
        mapping: Scale and offset.
    """
    offset = mapping.offset
    matrix = mapping.scale * rotation_matrix(offset.quaternion)
    return HandMap(matrix, offset.position, offset.quaternion, IDENTITY)


def close_clutch(
    mapping: OperatorMapping, hand: Float[Array, " D"], command: Float[Array, " D"], is_oriented: bool
) -> HandMap:
    """Return the map with which the command of a hand is the given one, except for its scalars.

    Args:
        mapping: Scale and offset.
        hand: Valid pose and scalars of the hand.
        command: Command that is to continue.
        is_oriented: Whether a quaternion follows the position.
    """
    unshifted = open_map(mapping)
    x = map_hand(unshifted, hand, is_oriented)
    turn = normalise(multiply(conjugate(x[3:7]), command[3:7])) if is_oriented else IDENTITY
    return replace(unshifted, shift=unshifted.shift + command[:3] - x[:3], right=turn)
