"""Quaternions w x y z: rotations of space, and points of the sphere S^3.

Leading axes are batch axes. The exponential and logarithmic map of S^3, `quaternion_exp` and
`quaternion_log`, take half a rotation vector, because q and -q are one rotation. For the full angle, use
`from_rotation_vector` and `to_rotation_vector`.
"""

import math

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import MAX_FLOAT, float_array, require_shapes_agree

CONJUGATE_SIGNS = np.array([1.0, -1.0, -1.0, -1.0])
MIN_NORM, MAX_NORM = 1e-70, 1e70  # lengths for which squares of products do not overflow or vanish
MAX_ANGLE = 1e6  # rad; beyond, float64 leaves fewer than nine digits of the angle
ROTATION_TOLERANCE = 1e-4  # a published rotation matrix carries about six digits


def multiply(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """Return the Hamilton product p q: the rotation by q, followed by that by p.

    Args:
        p: Quaternions w x y z.
        q: Quaternions w x y z.
    """
    p, q = float_array(p, "p", 4), float_array(q, "q", 4)
    require_shapes_agree(p=p, q=q)
    return hamilton_product(p, q)


def hamilton_product(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """Return p q as `multiply` does, without validation; two quaternions as numbers, which is faster."""
    if p.ndim == q.ndim == 1:
        (pw, px, py, pz), (qw, qx, qy, qz) = p.tolist(), q.tolist()
    else:
        pw, px, py, pz = p[..., 0], p[..., 1], p[..., 2], p[..., 3]
        qw, qx, qy, qz = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    w = pw * qw - px * qx - py * qy - pz * qz
    x = pw * qx + px * qw + py * qz - pz * qy
    y = pw * qy - px * qz + py * qw + pz * qx
    z = pw * qz + px * qy - py * qx + pz * qw
    return np.array([w, x, y, z]) if p.ndim == q.ndim == 1 else np.stack([w, x, y, z], axis=-1)


def conjugate(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """Return the conjugate q*, with q q* = |q|^2; it is the inverse of a unit quaternion.

    Args:
        q: Quaternions w x y z.
    """
    return np.asarray(float_array(q, "q", 4) * CONJUGATE_SIGNS)


def normalise(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """Return q / |q|, without overflow for large or small quaternions.

    Args:
        q: Quaternions w x y z.

    Raises:
        InvalidInput: If a quaternion is zero or not finite.
    """
    q = float_array(q, "q", 4, maximum=MAX_FLOAT)
    if np.abs(q).max(initial=0.0) > MAX_NORM or not _norms_in_range(q):
        longest = np.abs(q).max(axis=-1, keepdims=True)
        if (bad := np.argwhere(longest == 0.0)).size:
            raise InvalidInput(
                f"q: quaternion {tuple(bad[0, :-1].tolist())} has norm 0, expected a positive norm"
            )
        q = np.ldexp(q, -np.frexp(longest)[1])  # powers of two: no rounding
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def validate_quaternions(value: object, name: str) -> Float[Array, "*B 4"]:
    """Return an array of quaternions whose products neither overflow nor vanish.

    Args:
        value: Array of quaternions w x y z.
        name: Name of the argument; the error message begins with it.

    Raises:
        InvalidInput: If it is not, or a length is outside 1e-70 to 1e70.
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
    if q.ndim == 1:  # ten times as fast as NumPy for a single quaternion
        return MIN_NORM <= math.hypot(*q.tolist()) <= MAX_NORM
    return bool(_norm_in_range_mask(q).all())


def _norm_in_range_mask(q: Float[Array, "*B 4"]) -> Bool[Array, "*B"]:
    """Return which lengths are from 1e-70 to 1e70."""
    squares = np.einsum("...d,...d->...", q, q)
    return np.asarray((squares >= MIN_NORM**2) & (squares <= MAX_NORM**2))


def relative_quaternion(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """Return p* q, the rotation from p to q times the product of their lengths."""
    p, q = validate_quaternions(p, "p"), validate_quaternions(q, "q")
    require_shapes_agree(p=p, q=q)
    return hamilton_product(p * CONJUGATE_SIGNS, q)


def left_multiplication_matrix(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4 4"]:
    """Return the matrix E of multiplication from the left: E(q) p = q p.

    For a unit quaternion it is a rotation of R^4.

    Args:
        q: Quaternions w x y z.

    Source:
        Tanwani 2018, eq. 3.57.
    """
    w, x, y, z = np.moveaxis(float_array(q, "q", 4), -1, 0)
    rows = [[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_matrix(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3 3"]:
    """Return the matrix R with R v = q v q* for a vector v, taken as a pure quaternion.

    Args:
        q: Unit quaternions w x y z.
    """
    w, x, y, z = np.moveaxis(float_array(q, "q", 4), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation_matrix(R: Float[Array, "*B 3 3"]) -> Float[Array, "*B 4"]:
    """Return the unit quaternion of R with w >= 0.

    R determines 4 q q^T linearly; q is its longest column, so that the division is well conditioned.

    Args:
        R: Rotation matrices.

    Raises:
        InvalidInput: If R^T R differs from the identity by more than 1e-4, or det R is negative.

    Source:
        Shepperd 1978, J. Guidance and Control 1(3), in matrix form.
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
            f"R is not a rotation matrix: R^T R differs from the identity by {deviation:.3g}, expected at "
            f"most {ROTATION_TOLERANCE:g} and det R = 1; remove a reflection or a scaled axis first"
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
    """Return the unit quaternion cos|v| + sin|v| v/|v|, the exponential map of S^3 at 1.

    It is the rotation by the angle 2 |v| about v; `from_rotation_vector` takes the full angle.

    Args:
        v: Half rotation vectors [rad], at most 1e6 long.
    """
    v = float_array(v, "v", 3, maximum=MAX_ANGLE)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(length), np.sinc(length / np.pi) * v], axis=-1)


def quaternion_log(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3"]:
    """Return the v with quaternion_exp(v) = q / |q| and |v| <= pi, the logarithmic map of S^3 at 1.

    It is half a rotation vector. q and -q are two points of S^3 and have different logarithms. At q = -1
    every direction is valid; the result is (pi, 0, 0).

    Args:
        q: Quaternions w x y z.
    """
    q = validate_quaternions(q, "q")
    w, vector = q[..., :1], q[..., 1:]
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    direction = np.divide(vector, length, out=np.zeros_like(vector), where=length > 0)
    direction = np.where(length > 0, direction, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(length, w) * direction)


def angle(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B"]:
    """Return the angle of the rotation from p to q [rad], from 0 to pi.

    The signs and lengths of p and q do not matter.

    Args:
        p: Quaternions w x y z.
        q: Quaternions w x y z.
    """
    relative = relative_quaternion(p, q)
    half = np.arctan2(np.linalg.norm(relative[..., 1:], axis=-1), np.abs(relative[..., 0]))
    return np.asarray(2 * half)


def unwrap_quaternions(q: Float[Array, "T 4"]) -> Float[Array, "T 4"]:
    """Return the same rotations with signs chosen so that neighbours are on the same half of S^3.

    Args:
        q: Quaternions w x y z, one for each step; the first keeps its sign.

    Raises:
        InvalidInput: If q is not a finite array of shape (T, 4).
    """
    q = float_array(q, "q", 4)
    if q.ndim != 2:
        raise InvalidInput(f"q has shape {q.shape}, expected (T, 4): one quaternion for each step")
    flips = np.einsum("td,td->t", q[1:], q[:-1]) < 0
    signs = np.where(np.concatenate([[False], np.logical_xor.accumulate(flips)]), -1.0, 1.0)
    return q * signs[:, None]
