"""Map from the pose of an operator's hand to the pose that it commands."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MAX_COORDINATE = 1e4  # m, or the unit of a scalar; a hand farther away is a fault
MIN_NORM, MAX_NORM = 0.5, 2.0  # of the quaternion of a hand; outside, it is a fault


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class HandMap:
    """Position matrix p + shift, and orientation left q right.

    Attributes:
        matrix: Rotation and scale of positions.
        shift: Displacement of positions [m].
        left: Unit quaternion, a rotation in the axes of the world.
        right: Unit quaternion, a rotation in the axes of the hand.
    """

    matrix: Float[Array, "3 3"]
    shift: Float[Array, " 3"]
    left: Float[Array, " 4"]
    right: Float[Array, " 4"]


def is_valid_hand(hand: Float[Array, " D"], is_oriented: bool) -> bool:
    """Return whether a hand can be followed: finite, near enough, and with a quaternion of norm about one.

    Args:
        hand: Pose and scalars of the hand.
        is_oriented: Whether a quaternion follows the position.
    """
    if not (np.abs(hand) <= MAX_COORDINATE).all():  # false for NaN as well
        return False
    return not is_oriented or bool(MIN_NORM**2 <= hand[3:7] @ hand[3:7] <= MAX_NORM**2)


def map_hand(hand_map: HandMap, hand: Float[Array, " D"], is_oriented: bool) -> Float[Array, " D"]:
    """Return the command of a valid hand; its scalars pass unchanged.

    Args:
        hand_map: Map.
        hand: Pose and scalars of the hand.
        is_oriented: Whether a quaternion follows the position.
    """
    x = np.array(hand, dtype=np.float64)
    x[:3] = hand_map.matrix @ x[:3] + hand_map.shift
    if is_oriented:
        q = x[3:7] / np.sqrt(x[3:7] @ x[3:7])
        x[3:7] = quaternion_product(quaternion_product(hand_map.left, q), hand_map.right)
    return x


def quaternion_product(p: Float[Array, " 4"], q: Float[Array, " 4"]) -> Float[Array, " 4"]:
    """Return the Hamilton product p q.

    Args:
        p: Quaternion w x y z.
        q: Quaternion w x y z.
    """
    v = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], v])
