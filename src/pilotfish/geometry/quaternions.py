"""Unit quaternions w x y z: rotations of space, and points of the sphere S^3. A batch leads."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float

ROTATION_TOLERANCE = 1e-4  # a published rotation matrix carries about six digits


def multiply(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 4"]:
    """The Hamilton product p q: first turn by q, then by p."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    w = pw * qw - px * qx - py * qy - pz * qz
    x = pw * qx + px * qw + py * qz - pz * qy
    y = pw * qy - px * qz + py * qw + pz * qx
    z = pw * qz + px * qy - py * qx + pz * qw
    return np.stack([w, x, y, z], axis=-1)


def conjugate(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """The turn back: q conjugate(q) = |q|^2."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def normalise(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """The nearest unit quaternions.

    Raises: InvalidInput, when one has no direction: its norm is zero or not finite.
    """
    norms = np.linalg.norm(q, axis=-1, keepdims=True)
    if (bad := np.argwhere(~((norms > 0) & np.isfinite(norms)))).size:
        place = tuple(int(i) for i in bad[0, :-1])
        raise InvalidInput(f"quaternion {place} has norm {norms[(*place, 0)]}, expected a positive number")
    return np.asarray(q / norms)


def left_matrix(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4 4"]:
    """The matrix E of multiplying from the left: E(q) p = q p. A rotation of R^4 when q is a unit.

    Source: Tanwani 2018, eq. 3.57.
    """
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_matrix(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3 3"]:
    """The matrix R with R v = q v q*, v a pure quaternion. q has norm one."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def from_rotation_matrix(R: Float[Array, "*B 3 3"]) -> Float[Array, "*B 4"]:
    """The unit quaternion of R with w >= 0.

    R determines 4 q q^T linearly; q is its longest column, so that nothing small is divided by.
    Raises: InvalidInput, when R is no rotation: R^T R or det R is further than 1e-4 from one.
    Source: Shepperd 1978, J. Guidance and Control 1(3), in matrix form.
    """
    _refuse_non_rotation(R)
    outer = _outer_product_times_four(R)
    longest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    column = np.take_along_axis(outer, longest[..., None, None], axis=-1)[..., 0]
    return normalise(np.where(column[..., :1] < 0, -column, column))


def _refuse_non_rotation(R: Float[Array, "*B 3 3"]) -> None:
    finite = bool(np.isfinite(R).all())
    skew = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(initial=0.0) if finite else np.inf
    if skew > ROTATION_TOLERANCE or bool((np.linalg.det(R) < 0).any()):
        raise InvalidInput(
            f"R is no rotation matrix: R^T R differs from the identity by {skew:.3g}, expected at most "
            f"{ROTATION_TOLERANCE:g} and det R = 1; a mirror image or a scaled axis must be removed first"
        )


def _outer_product_times_four(R: Float[Array, "*B 3 3"]) -> Float[Array, "*B 4 4"]:
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


def exp(v: Float[Array, "*B 3"]) -> Float[Array, "*B 4"]:
    """The unit quaternion cos|v| + sin|v| v/|v|: a turn by 2|v| [rad] about v.

    So v is half a rotation vector.
    """
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(length), np.sinc(length / np.pi) * v], axis=-1)


def log(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3"]:
    """The v with exp(v) = q and |v| <= pi: half a rotation vector.

    q and -q have different logarithms, for they are two points of S^3. At q = -1 every direction would do;
    the answer is (pi, 0, 0).
    """
    w, vector = q[..., :1], q[..., 1:]
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    direction = np.divide(vector, length, out=np.zeros_like(vector), where=length > 0)
    direction = np.where(length > 0, direction, np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(length, w) * direction)


def angle(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B"]:
    """How far to turn from p to q [rad], 0 to pi. The signs of p and q do not matter."""
    between = multiply(conjugate(p), q)
    half = np.arctan2(np.linalg.norm(between[..., 1:], axis=-1), np.abs(between[..., 0]))
    return np.asarray(2 * half)


def continuous(q: Float[Array, "T 4"]) -> Float[Array, "T 4"]:
    """The same rotations with no sign flip from one to the next; the first keeps its sign."""
    flips = np.einsum("td,td->t", q[1:], q[:-1]) < 0
    signs = np.where(np.concatenate([[False], np.logical_xor.accumulate(flips)]), -1.0, 1.0)
    return q * signs[:, None]
