"""Rotation vectors [rad] as coordinates of rotations: the vector v is the rotation by |v| about v.

As a unit quaternion it is exp(v / 2). The right Jacobian relates a change of v to a rotation in body axes.
"""

from collections.abc import Callable, Sequence

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry.quaternions import (
    MAX_ANGLE,
    conjugate,
    multiply,
    quaternion_exp,
    quaternion_log,
    relative_quaternion,
)
from pilotfish.types import Array, Float
from pilotfish.validation import float_array, require_shapes_agree

SERIES_MAX_ANGLE = 0.3  # rad; below it quotients cancel, and their series are exact to rounding


def from_rotation_vector(v: Float[Array, "*B 3"]) -> Float[Array, "*B 4"]:
    """Return the unit quaternion of the rotation by |v| about v (exponential map, full angle).

    Args:
        v: Rotation vectors [rad], at most 2e6 long.
    """
    return quaternion_exp(0.5 * float_array(v, "v", 3, maximum=2.0 * MAX_ANGLE))


def to_rotation_vector(q: Float[Array, "*B 4"]) -> Float[Array, "*B 3"]:
    """Return the rotation vector [rad] of q, of length up to 2 pi (logarithmic map, full angle).

    q and -q give the two ways round; pass the one with w >= 0 for the shorter one.

    Args:
        q: Quaternions w x y z.
    """
    return 2.0 * quaternion_log(q)


def relative_rotation_vector(p: Float[Array, "*#B 4"], q: Float[Array, "*#B 4"]) -> Float[Array, "*B 3"]:
    """Return the rotation vector [rad] from p to q in the body axes of p: 2 log(p* q), at most pi long.

    Of q and -q it uses the nearer one. The lengths of p and q do not matter.

    Args:
        p: Quaternions w x y z.
        q: Quaternions w x y z.
    """
    relative = relative_quaternion(p, q)
    relative = np.where(relative[..., :1] < 0.0, -relative, relative)
    sine = np.linalg.norm(relative[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, relative[..., :1])
    return np.asarray(relative[..., 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0))


def rotation_vector_in_world(p: Float[Array, " 4"], q: Float[Array, " 4"]) -> Float[Array, " 3"]:
    """Return the shorter rotation vector [rad] from p to q in world axes, 2 log(q p*).

    Args:
        p: Unit quaternion w x y z.
        q: Unit quaternion w x y z.
    """
    relative = multiply(q, conjugate(p))
    return to_rotation_vector(relative if relative[0] >= 0.0 else -relative)


def skew_matrix(v: Float[Array, "*B 3"]) -> Float[Array, "*B 3 3"]:
    """Return the matrix [v] with [v] w = v x w.

    Args:
        v: Vectors.
    """
    x, y, z = np.moveaxis(float_array(v, "v", 3), -1, 0)
    o = np.zeros_like(x)
    rows = [[o, -z, y], [z, o, -x], [-y, x, o]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def right_jacobian(v: Float[Array, "*B 3"]) -> Float[Array, "*B 3 3"]:
    """Return J with exp((v + h) / 2) = exp(v / 2) exp(J h / 2) to first order in h.

    The angular velocity in body axes is J dv/dt. J is singular at |v| = 2 pi.

    Args:
        v: Rotation vectors [rad].

    Source:
        Chirikjian 2012, Stochastic Models, Information Theory, and Lie Groups 2, section 10.6.
    """
    v = float_array(v, "v", 3, maximum=MAX_ANGLE)
    V, angle = skew_matrix(v), _angles(v)
    one_minus_cosine = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2  # (1 - cos a) / a^2
    second_order = _evaluate_with_series(
        angle, lambda a: (a - np.sin(a)) / a**3, [1 / 6, -1 / 120, 1 / 5040, -1 / 362880]
    )
    return np.asarray(np.eye(3) - one_minus_cosine * V + second_order * (V @ V))


def inverse_right_jacobian(v: Float[Array, "*B 3"]) -> Float[Array, "*B 3 3"]:
    """Return the inverse of `right_jacobian`: dv/dt = J^-1 times the angular velocity in body axes.

    Args:
        v: Rotation vectors [rad], shorter than 2 pi.

    Raises:
        InvalidInput: If a vector is not finite or too long.
    """
    v = _validate_invertible(v)
    V = skew_matrix(v)
    return np.asarray(np.eye(3) + 0.5 * V + _second_order_coefficient(_angles(v)) * (V @ V))


def inverse_right_jacobian_derivative(
    v: Float[Array, "*#B 3"], w: Float[Array, "*#B 3"]
) -> Float[Array, "*B 3 3"]:
    """Return the derivative of inverse_right_jacobian(v) @ w with respect to v.

    Args:
        v: Rotation vectors [rad], shorter than 2 pi.
        w: Vectors, which are constant.

    Raises:
        InvalidInput: If a vector is not finite or too long.
    """
    v, w = _validate_invertible(v), float_array(w, "w", 3)
    require_shapes_agree(v=v, w=w)
    V, W, angle = skew_matrix(v), skew_matrix(w), _angles(v)
    double_cross = np.cross(v, np.cross(v, w))  # V V w
    outer = double_cross[..., :, None] * v[..., None, :]
    inner = skew_matrix(np.cross(v, w)) + V @ W
    return np.asarray(
        -0.5 * W - _second_order_coefficient(angle) * inner + _second_order_coefficient_slope(angle) * outer
    )


def _validate_invertible(v: object) -> Float[Array, "*B 3"]:
    """Return v, or raise InvalidInput where right_jacobian has no inverse."""
    vectors = float_array(v, "v", 3, maximum=MAX_ANGLE)
    lengths = np.linalg.norm(vectors, axis=-1)
    if lengths.max(initial=0.0) >= 2.0 * np.pi:
        index = tuple(np.argwhere(lengths >= 2.0 * np.pi)[0].tolist())
        raise InvalidInput(
            f"v: rotation vector {index} is {lengths[index]:.6g} rad long, expected less than 2 pi; use the "
            "equivalent rotation vector of at most pi"
        )
    return vectors


def _angles(v: Float[Array, "*B 3"]) -> Float[Array, "*B 1 1"]:
    return np.asarray(np.linalg.norm(v, axis=-1)[..., None, None])


def _second_order_coefficient(angle: Float[Array, "*B"]) -> Float[Array, "*B"]:
    """Return (1 - (a / 2) cot(a / 2)) / a^2."""
    series = [1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160]
    return _evaluate_with_series(angle, lambda a: (1.0 - 0.5 * a / np.tan(0.5 * a)) / a**2, series)


def _second_order_coefficient_slope(angle: Float[Array, "*B"]) -> Float[Array, "*B"]:
    """Return the derivative of _second_order_coefficient by a, divided by a."""

    def quotient(a: Float[Array, "*B"]) -> Float[Array, "*B"]:
        half = 0.5 * a
        change = 0.25 * a / np.sin(half) ** 2 - 0.5 / np.tan(half)
        return np.asarray((change - 2.0 * (1.0 - half / np.tan(half)) / a) / a**3)

    return _evaluate_with_series(angle, quotient, [1 / 360, 1 / 7560, 1 / 201600, 1 / 5987520])


def _evaluate_with_series(
    angle: Float[Array, "*B"],
    quotient: Callable[[Float[Array, "*B"]], Float[Array, "*B"]],
    series: Sequence[float],
) -> Float[Array, "*B"]:
    """Return quotient(angle), from its even power series for small angles."""
    small = angle < SERIES_MAX_ANGLE
    power = np.polynomial.polynomial.polyval(np.where(small, angle, 0.0) ** 2, series)
    return np.asarray(np.where(small, power, quotient(np.where(small, 1.0, angle))))
