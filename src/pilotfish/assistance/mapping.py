"""Direct control: from the operator's hand to the pose that it commands, with scale, offset and clutch.

    position     p = p_0 + R_0 (scale p_hand) + shift
    orientation  q = q_0 q_hand turn

(p_0, R_0) is the offset, fixed at construction: the pose of the operator's coordinate system in the robot's
world. Shift and turn change with the clutch. While it is open the command holds, and when it closes they are
chosen so that the command continues where it was, however the hand moved in between. The turn stands on the
right, so that rotations of the hand about axes of the world stay rotations about these axes. Scalars such as
a grip pass unchanged while the clutch is closed.
"""

from dataclasses import dataclass, field

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.geometry import Pose, conjugate, multiply, normalise, rotation_matrix
from pilotfish.geometry import pose as validated_pose
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type

MAX_COORDINATE = 1e4  # m, or the unit of a scalar; a hand farther away is a fault
MIN_NORM, MAX_NORM = 0.5, 2.0  # of the quaternion of a hand; outside, it is a fault
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


@dataclass(frozen=True, slots=True, eq=False)
class Clutch:
    """Displacement that the clutch has collected.

    Attributes:
        closed: Whether the robot followed the hand in the last step.
        shift: Displacement of the position [m].
        turn: Rotation of the orientation.
    """

    closed: bool
    shift: Float[Array, " 3"]
    turn: Float[Array, " 4"]


OPEN_CLUTCH = Clutch(False, np.zeros(3), IDENTITY)


def is_valid_hand(hand: Float[Array, " D"], layout: Layout) -> bool:
    """Return whether a hand can be followed: right width, finite, near enough, a quaternion of norm about 1.

    Args:
        hand: Pose and scalars of the hand.
        layout: Layout from `coordinate_layout`.
    """
    if np.shape(hand) != (layout.width,) or np.asarray(hand).dtype.kind not in "fiu":
        return False
    if not (np.abs(hand) <= MAX_COORDINATE).all():  # false for NaN as well
        return False
    norms = [float(np.linalg.norm(hand[columns])) for columns in layout.unit_quaternions]
    return all(MIN_NORM <= norm <= MAX_NORM for norm in norms)


def map_hand(
    mapping: OperatorMapping, clutch: Clutch, hand: Float[Array, " D"], layout: Layout
) -> Float[Array, " D"]:
    """Return the command of a hand, as at the head of this file.

    Args:
        mapping: Scale and offset.
        clutch: Displacement of the clutch.
        hand: Valid pose and scalars of the hand.
        layout: Layout from `coordinate_layout`.
    """
    x = np.array(hand, dtype=np.float64)
    offset = mapping.offset
    x[:3] = offset.position + rotation_matrix(offset.quaternion) @ (mapping.scale * x[:3]) + clutch.shift
    for columns in layout.unit_quaternions:
        x[columns] = multiply(multiply(offset.quaternion, normalise(x[columns])), clutch.turn)
    return x


def close_clutch(
    mapping: OperatorMapping, hand: Float[Array, " D"], command: Float[Array, " D"], layout: Layout
) -> Clutch:
    """Return a closed clutch with which the command of a hand is the given one, except for its scalars.

    Args:
        mapping: Scale and offset.
        hand: Valid pose and scalars of the hand.
        command: Command that is to continue.
        layout: Layout from `coordinate_layout`.
    """
    unshifted = map_hand(mapping, OPEN_CLUTCH, hand, layout)
    turn = IDENTITY
    for columns in layout.unit_quaternions:
        turn = normalise(multiply(conjugate(unshifted[columns]), command[columns]))
    return Clutch(True, command[:3] - unshifted[:3], turn)
