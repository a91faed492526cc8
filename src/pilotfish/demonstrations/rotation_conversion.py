"""Rotations in the forms that files have, converted to unit quaternions w x y z."""

from typing import Literal, get_args

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import conjugate as conjugate_quaternions
from pilotfish.geometry import (
    from_rotation_vector,
    multiply,
    normalise,
    quaternion_exp,
    quaternion_from_rotation_matrix,
    quaternion_log,
    unwrap_quaternions,
)
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, short_repr

Representation = Literal["wxyz", "xyzw", "rpy", "matrix", "rotation vector", "yaw"]
REPRESENTATIONS: tuple[Representation, ...] = get_args(Representation)
COLUMN_COUNTS: dict[Representation, int] = {
    "wxyz": 4,
    "xyzw": 4,
    "rpy": 3,
    "matrix": 9,
    "rotation vector": 3,
    "yaw": 1,
}
ANGULAR = ("rpy", "rotation vector", "yaw")  # forms in units of angles
MAX_NORM_DEVIATION = 0.01  # of a quaternion from 1: rounding to two digits


def require_representation(value: object, label: str = "representation") -> Representation:
    """Return the representation of an orientation if it is a known one.

    Args:
        value: One of "wxyz", "xyzw", "rpy", "matrix", "rotation vector" and "yaw".
        label: Meaning of the value; the message begins with it.

    Raises:
        InvalidInput: If it is not.
    """
    for known in REPRESENTATIONS:
        if isinstance(value, str) and value == known:
            return known
    raise InvalidInput(
        f"{label} is {short_repr(value)}, expected one of {', '.join(REPRESENTATIONS)}; ROS writes xyzw"
    )


def to_quaternions(
    values: object, representation: Representation, label: str = "orientation"
) -> Float[Array, "T 4"]:
    """Return unit quaternions w x y z whose signs do not change from row to row.

    Args:
        values: One rotation per row: a quaternion in the stated order, roll, pitch and yaw about the fixed
            axes x, y and z in this order [rad], a matrix of nine numbers row by row, a rotation vector [rad],
            or the angle about the vertical axis z [rad].
        representation: Meaning of the columns.
        label: Name of the orientation; messages begin with it.

    Raises:
        InvalidInput: If the number of columns differs, a quaternion is not of norm 1 within 0.01, or a matrix
            is not a rotation.
    """
    kind = require_representation(representation, f"{label}: representation")
    rows = finite_array(values, label)
    if rows.ndim != 2 or rows.shape[1] != COLUMN_COUNTS[kind]:
        raise InvalidInput(f"{label} has shape {rows.shape}, expected (T, {COLUMN_COUNTS[kind]}) for {kind}")
    try:
        return unwrap_quaternions(_convert(rows, kind, label))
    except InvalidInput as error:
        raise InvalidInput(str(error) if str(error).startswith(label) else f"{label}: {error}") from error


def slerp(
    p: Float[Array, "T 4"], q: Float[Array, "T 4"], fraction: Float[Array, " T"]
) -> Float[Array, "T 4"]:
    """Interpolate from p to q at constant angular velocity: p exp(fraction log(p* q)).

    The shorter way is taken only if p and q are on the same half of S^3; see `unwrap_quaternions`.

    Args:
        p: Unit quaternions w x y z.
        q: Unit quaternions w x y z.
        fraction: 0 for p, 1 for q.

    Source:
        Shoemake 1985, Animating rotation with quaternion curves.
    """
    relative = quaternion_log(multiply(conjugate_quaternions(p), q))
    return multiply(p, quaternion_exp(fraction[:, None] * relative))


def _convert(rows: Float[Array, "T c"], kind: Representation, label: str) -> Float[Array, "T 4"]:
    match kind:
        case "wxyz":
            return _normalise_rounded(rows, label)
        case "xyzw":
            return _normalise_rounded(np.roll(rows, 1, axis=1), label)
        case "rpy":
            roll, pitch, yaw = (_axis_rotation(rows[:, axis], axis) for axis in range(3))
            return multiply(yaw, multiply(pitch, roll))
        case "matrix":
            return quaternion_from_rotation_matrix(rows.reshape(-1, 3, 3))
        case "rotation vector":
            return from_rotation_vector(rows)
        case "yaw":
            return _axis_rotation(rows[:, 0], 2)


def _axis_rotation(angles: Float[Array, " T"], axis: int) -> Float[Array, "T 4"]:
    vectors = np.zeros((len(angles), 3))
    vectors[:, axis] = angles
    return from_rotation_vector(vectors)


def _normalise_rounded(q: Float[Array, "T 4"], label: str) -> Float[Array, "T 4"]:
    """Return quaternions of norm 1; those that have it to rounding are not changed."""
    norms = np.linalg.norm(q, axis=1)
    if (bad := np.flatnonzero(~(np.abs(norms - 1) <= MAX_NORM_DEVIATION))).size:
        raise InvalidInput(
            f"{label}: row {bad[0]} (first is 0) has norm {norms[bad[0]]:.4g}, expected a quaternion of norm "
            f"1 ({bad.size} such rows); check which columns are the orientation, or remove lost poses"
        )
    rounding = np.abs(norms - 1) < 1e-12
    return np.where(rounding[:, None], q, normalise(q))
