"""Exponential and logarithmic maps of R^n x S^3 x ..., with rotation vectors in body axes."""

import numpy as np

from pilotfish.kernels.hand_map import quaternion_product
from pilotfish.types import Array, Float

SMALL_ANGLE = 1e-2  # rad; below, series are more exact


def deviations(
    x: Float[Array, "N D"], mean: Float[Array, " D"], orientation_starts: tuple[int, ...] = ()
) -> Float[Array, "N E"]:
    """Return x - mean, and on unit quaternions the rotation vector 2 log(mean* x) [rad] in body axes."""
    parts, end = [], 0
    for start in sorted(orientation_starts):
        parts += [
            x[:, end:start] - mean[end:start],
            rotation_vectors(mean[start : start + 4], x[:, start : start + 4]),
        ]
        end = start + 4
    return np.concatenate([*parts, x[:, end:] - mean[end:]], axis=1)


def rotation_vectors(mean: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """Return 2 log(mean* q), for the nearer of q and -q, so that it is at most pi long."""
    w, x, y, z = mean
    # multiplication by mean* from the left
    conjugate_matrix = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    relative = q @ conjugate_matrix.T
    relative = np.where(relative[:, :1] < 0.0, -relative, relative)
    sine = np.linalg.norm(relative[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, relative[:, :1])
    return np.asarray(relative[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0))


def displaced(
    base: Float[Array, " D"], v: Float[Array, " E"], orientation_starts: tuple[int, ...] = ()
) -> Float[Array, " D"]:
    """Return the point that the geodesic from base along v reaches: base + v, and base exp(v / 2) on S^3."""
    parts, end, shift = [], 0, 0
    for start in sorted(orientation_starts):
        turn = _unit_quaternion(v[start - shift : start - shift + 3])
        parts += [
            base[end:start] + v[end - shift : start - shift],
            quaternion_product(base[start : start + 4], turn),
        ]
        end, shift = start + 4, shift + 1
    return np.concatenate([*parts, base[end:] + v[end - shift :]])


def displacement_jacobian(
    v: Float[Array, " E"], orientation_starts: tuple[int, ...] = ()
) -> Float[Array, "E E"]:
    """Return J with displaced(base, v + h) = displaced(displaced(base, v), J h) to first order in h."""
    J = np.eye(len(v))
    for shift, start in enumerate(sorted(orientation_starts)):
        columns = slice(start - shift, start - shift + 3)
        x, y, z = turn = v[columns]
        V = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        a = np.sqrt(turn @ turn)
        first = 0.5 * np.sinc(a / (2.0 * np.pi)) ** 2  # (1 - cos a) / a^2
        series = 1.0 / 6.0 - a * a / 120.0 + a**4 / 5040.0
        second = series if a < SMALL_ANGLE else (a - np.sin(a)) / a**3
        J[columns, columns] += second * (V @ V) - first * V
    return J


def _unit_quaternion(v: Float[Array, " 3"]) -> Float[Array, " 4"]:
    """Return exp(v / 2), the rotation by |v| about v."""
    half = 0.5 * v
    angle = np.sqrt(half @ half)
    return np.concatenate([[np.cos(angle)], half * (np.sin(angle) / angle if angle > 0.0 else 1.0)])
