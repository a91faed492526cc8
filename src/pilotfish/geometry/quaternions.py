"""Unit quaternions w x y z: rotations of space, and points of the sphere S^3. A batch leads."""

import math

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import MAX_FLOAT, float_array, require_shapes_agree

CONJUGATE_SIGNS = np.array([1.0, -1.0, -1.0, -1.0])
MIN_NORM, MAX_NORM = 1e-70, 1e70  # of quaternions whose products' squares are taken
MAX_ANGLE = 1e6  # rad; beyond, float64 leaves fewer than nine digits of the angle
ROTATION_TOLERANCE = 1e-4  # a published rotation matrix carries about six digits


def multiply(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """The Hamilton product p q: first turn by q, then by p."""
    p, q = float_array(p, "p", 4), float_array(q, "q", 4)
    require_shapes_agree(p=p, q=q)
    return hamilton_product(p, q)


def hamilton_product(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """Return p q as multiply does, for arrays that were checked before."""
    pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
    qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    w = pw * qw - px * qx - py * qy - pz * qz
    x = pw * qx + px * qw + py * qz - pz * qy
    y = pw * qy - px * qz + py * qw + pz * qx
    z = pw * qz + px * qy - py * qx + pz * qw
    return np.stack([w, x, y, z], axis=-1)


def conjugate(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """The turn back: q conjugate(q) = |q|^2."""
    return np.asarray(float_array(q, "q", 4) * CONJUGATE_SIGNS)


def normalise(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """Return the nearest unit quaternions; of any length, however large or small.

    Raises:
        InvalidInput: If one has no direction: it is zero or not finite.
    """
    q = float_array(q, "q", 4, maximum=MAX_FLOAT)
    if np.abs(q).max(initial=0.0) > MAX_NORM or not _norms_in_range(q):
        longest = np.abs(q).max(axis=-1, keepdims=True)
        if (bad := np.argwhere(longest == 0.0)).size:
            raise InvalidInput(
                f"quaternion {tuple(bad[0, :-1].tolist())} has norm 0, expected a positive number"
            )
        q = np.ldexp(q, -np.frexp(longest)[1])  # by powers of two, so that no digit is lost
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def validate_quaternions(value: object, name: str) -> Float[Array, "*B 4"]:
    """Return an array of quaternions whose products neither overflow nor vanish.

    Raises:
        InvalidInput: If it is something else, or one has a length below 1e-70 or beyond 1e70.
    """
    q = float_array(value, name, 4)
    if not _norms_in_range(q):
        index = tuple(np.argwhere(~_norm_in_range_mask(q))[0].tolist())
        raise InvalidInput(
            f"{name}: quaternion {index} is {q[index].tolist()}, expected a length from {MIN_NORM:g} to "
            f"{MAX_NORM:g}; pass geometry.normalise({name})"
        )
    return q


def _norms_in_range(q: Float[Array, "*B 4"]) -> bool:
    if q.ndim == 1:  # for one quaternion, NumPy takes ten times as long
        return MIN_NORM <= math.hypot(*q.tolist()) <= MAX_NORM
    return bool(_norm_in_range_mask(q).all())


def _norm_in_range_mask(q: Float[Array, "*B 4"]) -> Bool[Array, "*B"]:
    """Which lengths are from 1e-70 to 1e70."""
    squares = np.einsum("...d,...d->...", q, q)
    return np.asarray((squares >= MIN_NORM**2) & (squares <= MAX_NORM**2))


def relative_quaternion(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """Return p* q, the turn from p to q times the product of their lengths."""
    p, q = validate_quaternions(p, "p"), validate_quaternions(q, "q")
    require_shapes_agree(p=p, q=q)
    return hamilton_product(p * CONJUGATE_SIGNS, q)


def left_multiplication_matrix(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4 4"]:
    """The matrix E of multiplying from the left: E(q) p = q p. A rotation of R^4 when q is a unit.

    Source: Tanwani 2018, eq. 3.57.
    """
    w, x, y, z = np.moveaxis(float_array(q, "q", 4), -1, 0)
    rows = [[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_matrix(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3 3"]:
    """The matrix R with R v = q v q*, v a pure quaternion. q has norm one."""
    w, x, y, z = np.moveaxis(float_array(q, "q", 4), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation_matrix(R: Float[Array, "*B 3 3"]) -> Float[Array, "*B 4"]:
    """The unit quaternion of R with w >= 0.

    R determines 4 q q^T linearly; q is its longest column, so that nothing small is divided by.
    Raises: InvalidInput, when R is no rotation: R^T R or det R is further than 1e-4 from one.
    Source: Shepperd 1978, J. Guidance and Control 1(3), in matrix form.
    """
    R = float_array(R, "R", 3)
    _validate_rotation_matrix(R)
    outer = _scaled_outer_product(R)
    longest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    column = np.take_along_axis(outer, longest[..., None, None], axis=-1)[..., 0]
    return normalise(np.where(column[..., :1] < 0, -column, column))


def _validate_rotation_matrix(R: Float[Array, "*B 3 3"]) -> None:
    if R.ndim < 2 or R.shape[-2] != 3:
        raise InvalidInput(f"R has shape {R.shape}, expected (..., 3, 3)")
    deviation = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(initial=0.0)
    if deviation > ROTATION_TOLERANCE or bool((np.linalg.det(R) < 0).any()):
        raise InvalidInput(
            f"R is no rotation matrix: R^T R differs from the identity by {deviation:.3g}, expected at most "
            f"{ROTATION_TOLERANCE:g} and det R = 1; a mirror image or a scaled axis must be removed first"
        )


def _scaled_outer_product(R: Float[Array, "*B 3 3"]) -> Float[Array, "*B 4 4"]:
    a, b, c = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    wx, wy, wz = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    rows = [
        [1 + a + b + c, wx, wy, wz],
        [wx, 1 + a - b - c, xy, xz],
        [wy, xy, 1 - a + b - c, yz],
        [wz, xz, yz, 1 - a - b + c],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_exp(v: Float[Array, "*B 3"]) -> Float[Array, "*B 4"]:
    """The unit quaternion cos|v| + sin|v| v/|v|: a turn by 2|v| [rad] about v.

    So v is half a rotation vector.
    """
    v = float_array(v, "v", 3, maximum=MAX_ANGLE)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(length), np.sinc(length / np.pi) * v], axis=-1)


def quaternion_log(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3"]:
    """The v with exp(v) = q and |v| <= pi: half a rotation vector.

    q and -q have different logarithms, for they are two points of S^3. At q = -1 every direction would do;
    the answer is (pi, 0, 0).
    """
    q = validate_quaternions(q, "q")
    w, vector = q[..., :1], q[..., 1:]
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    direction = np.divide(vector, length, out=np.zeros_like(vector), where=length > 0)
    direction = np.where(length > 0, direction, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(length, w) * direction)


def angle(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B"]:
    """How far to turn from p to q [rad], 0 to pi. The signs of p and q do not matter."""
    relative = relative_quaternion(p, q)
    half = np.arctan2(np.linalg.norm(relative[..., 1:], axis=-1), np.abs(relative[..., 0]))
    return np.asarray(2 * half)


def unwrap_quaternions(q: Float[Array, "T 4"]) -> Float[Array, "T 4"]:
    """The same rotations with no sign flip from one to the next; the first keeps its sign."""
    q = float_array(q, "q", 4)
    if q.ndim != 2:
        raise InvalidInput(f"q has shape {q.shape}, expected (T, 4): one quaternion for each step")
    flips = np.einsum("td,td->t", q[1:], q[:-1]) < 0
    signs = np.where(np.concatenate([[False], np.logical_xor.accumulate(flips)]), -1.0, 1.0)
    return q * signs[:, None]
