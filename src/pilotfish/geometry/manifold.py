"""Exponential and logarithmic maps of R^n x S^3 x ...: rows in which some columns are unit quaternions.

`orientation_starts` holds the first column of each quaternion. A tangent vector has three columns where its
point has four: a rotation vector [rad] in body axes. So x = base exp(v / 2) on an orientation, and x = base +
v elsewhere. Body axes do not depend on the world frame. q and -q are the same orientation.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry.quaternions import hamilton_product, rotation_matrix
from pilotfish.geometry.rotation_vectors import (
    from_rotation_vector,
    inverse_right_jacobian,
    relative_rotation_vector,
    right_jacobian,
)
from pilotfish.types import Array, Float
from pilotfish.validation import float_array, require_count, require_shapes_agree, short_repr

MAX_WIDTH = 10**6  # columns
MAX_MEAN_ITERATIONS, MEAN_TOLERANCE = 100, 1e-12  # rad
TINY = float(np.finfo(float).tiny)


def tangent_slices(width: int, orientation_starts: tuple[int, ...]) -> Iterator[tuple[slice, slice, bool]]:
    """Yield the columns of points and of tangent vectors of each part, and whether it is an orientation.

    Args:
        width: Number of columns of the points, D.
        orientation_starts: First column of each quaternion.

    Raises:
        InvalidInput: If quaternions overlap or exceed the width.
    """
    try:
        return iter(_tangent_slices(width, orientation_starts))
    except TypeError:  # an element cannot be hashed
        require_orientation_starts(width, orientation_starts)
        raise


@lru_cache(maxsize=256)  # a fit calls it thousands of times with the same arguments
def _tangent_slices(width: int, orientation_starts: tuple[int, ...]) -> tuple[tuple[slice, slice, bool], ...]:
    require_orientation_starts(width, orientation_starts)
    slices, end, tangent = [], 0, 0
    for start in (*sorted(orientation_starts), width):
        if start > end:
            slices.append((slice(end, start), slice(tangent, tangent + start - end), False))
            tangent += start - end
        if start < width:
            slices.append((slice(start, start + 4), slice(tangent, tangent + 3), True))
            tangent += 3
        end = start + 4
    return tuple(slices)


def tangent_dimension(width: int, orientation_starts: tuple[int, ...]) -> int:
    """Return the number of columns of tangent vectors at points with the given width.

    Args:
        width: Number of columns of the points, D.
        orientation_starts: First column of each quaternion.

    Raises:
        InvalidInput: If quaternions overlap or exceed the width.
    """
    require_orientation_starts(width, orientation_starts)
    return width - len(orientation_starts)


def require_orientation_starts(width: object, orientation_starts: object) -> None:
    """Raise InvalidInput unless starts are first columns of quaternions that do not overlap."""
    columns = require_count(width, "width", MAX_WIDTH)
    if not isinstance(orientation_starts, tuple):
        raise InvalidInput(
            f"orientation_starts is {short_repr(orientation_starts)}, expected a tuple of first columns, "
            "such as (3,)"
        )
    end = 0
    for start in sorted(require_count(start, "orientation_starts", columns) for start in orientation_starts):
        if start < end or start + 4 > columns:
            raise InvalidInput(
                f"orientation_starts is {short_repr(orientation_starts)}, expected first columns of "
                f"quaternions of four columns each, which do not overlap, among {columns} columns"
            )
        end = start + 4


def log_map(
    base: Float[Array, "*#B D"], x: Float[Array, "*#B D"], orientation_starts: tuple[int, ...]
) -> Float[Array, "*B E"]:
    """Return the tangent vector at base whose geodesic reaches x (logarithmic map).

    It is x - base, and 2 log(base* x) on orientations. Of x and -x it uses the nearer one, so that rotation
    vectors are at most pi long.

    Args:
        base: Points.
        x: Points.
        orientation_starts: First column of each quaternion.

    Raises:
        InvalidInput: If arrays or orientation_starts do not match.
    """
    base = float_array(base, "base")
    x = float_array(x, "x", _width(base, "base"))
    require_shapes_agree(base=base, x=x)
    parts = [
        relative_rotation_vector(base[..., columns], x[..., columns])
        if is_orientation
        else x[..., columns] - base[..., columns]
        for columns, _, is_orientation in tangent_slices(base.shape[-1], orientation_starts)
    ]
    return np.concatenate(parts, axis=-1)


def exp_map(
    base: Float[Array, "*#B D"], v: Float[Array, "*#B E"], orientation_starts: tuple[int, ...]
) -> Float[Array, "*B D"]:
    """Return the point that the geodesic from base along v reaches at time one (exponential map).

    It is base + v, and base exp(v / 2) on orientations.

    Args:
        base: Points.
        v: Tangent vectors at the base points.
        orientation_starts: First column of each quaternion.

    Raises:
        InvalidInput: If arrays or orientation_starts do not match.
    """
    base = float_array(base, "base")
    v = float_array(v, "v", tangent_dimension(_width(base, "base"), orientation_starts))
    require_shapes_agree(base=base, v=v)
    parts = [
        hamilton_product(base[..., columns], from_rotation_vector(v[..., tangent_columns]))
        if is_orientation
        else base[..., columns] + v[..., tangent_columns]
        for columns, tangent_columns, is_orientation in tangent_slices(base.shape[-1], orientation_starts)
    ]
    return np.concatenate(parts, axis=-1)


def parallel_transport(
    d: Float[Array, "*B E"], orientation_starts: tuple[int, ...]
) -> Float[Array, "*B E E"]:
    """Return the matrix that moves tangent vectors from a point to exp_map(point, d) by parallel transport.

    In body axes it is a rotation by -d / 2 on each orientation, because the axes themselves rotate by d.

    Args:
        d: Tangent vector from the one point to the other.
        orientation_starts: First column of each quaternion.

    Source:
        do Carmo 1992, Riemannian Geometry, for the sphere; the bi-invariant metric of its group.
    """
    return _block_diagonal(d, orientation_starts, lambda v: rotation_matrix(from_rotation_vector(-0.5 * v)))


def exp_map_jacobian(v: Float[Array, "*B E"], orientation_starts: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """Return J with exp_map(base, v + h) = exp_map(exp_map(base, v), J h) to first order in h.

    It is `right_jacobian` on orientations and the identity elsewhere; J v = v.

    Args:
        v: Tangent vectors.
        orientation_starts: First column of each quaternion.
    """
    return _block_diagonal(v, orientation_starts, right_jacobian)


def log_map_jacobian(v: Float[Array, "*B E"], orientation_starts: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """Return the derivative of v = log_map(base, x) with respect to a step in the tangent space at x.

    It is the inverse of `exp_map_jacobian`.

    Args:
        v: Tangent vectors, with rotation vectors shorter than 2 pi.
        orientation_starts: First column of each quaternion.
    """
    return _block_diagonal(v, orientation_starts, inverse_right_jacobian)


def karcher_mean(
    x: Float[Array, "N D"], weights: Float[Array, " N"], orientation_starts: tuple[int, ...]
) -> Float[Array, " D"]:
    """Return the point at which the weighted tangent vectors to all x sum to zero.

    Signs of quaternions do not matter; the mean has w >= 0. It is unique if all x lie within pi / 2 [rad] of
    it. The iteration starts at the chordal mean, the leading eigenvector of the weighted sum of x x^T.

    Args:
        x: Points.
        weights: Weight of each point, at least 0.
        orientation_starts: First column of each quaternion.

    Raises:
        InvalidInput: If arrays or orientation_starts do not match, or a weight is negative.

    Source:
        Karcher 1977; Markley et al. 2007 for the start.
    """
    x, weights = float_array(x, "x"), float_array(weights, "weights")
    if x.ndim != 2 or weights.shape != x.shape[:1] or weights.min(initial=0.0) < 0.0:
        raise InvalidInput(
            f"x has shape {x.shape} and weights {weights.shape}, expected (N, D) and (N,), no weight below "
            "zero"
        )
    require_orientation_starts(x.shape[1], orientation_starts)
    x, weights = x[weights > 0.0], weights[weights > 0.0] / max(float(weights.sum()), TINY)
    mean = weights @ x
    for start in orientation_starts:
        q = x[:, start : start + 4]
        mean[start : start + 4] = np.linalg.eigh((weights[:, None] * q).T @ q)[1][:, -1]
    for _ in range(MAX_MEAN_ITERATIONS if orientation_starts else 0):
        step = weights @ log_map(mean, x, orientation_starts)
        mean = exp_map(mean, step, orientation_starts)
        if np.abs(step).max() < MEAN_TOLERANCE:
            break
    for start in orientation_starts:
        mean[start : start + 4] *= -1.0 if mean[start] < 0.0 else 1.0
    return np.asarray(mean)


def _width(array: Float[Array, "*B D"], name: str) -> int:
    if array.ndim == 0:
        raise InvalidInput(f"{name} is a scalar, expected an array of rows")
    return int(array.shape[-1])


def _block_diagonal(
    v: Float[Array, "*B E"],
    orientation_starts: tuple[int, ...],
    block: Callable[[Float[Array, "*B 3"]], Float[Array, "*B 3 3"]],
) -> Float[Array, "*B E E"]:
    """Return the identity with block(v) in place of the columns of every orientation."""
    v = float_array(v, "v")
    E = _width(v, "v")
    if not isinstance(orientation_starts, tuple):
        raise InvalidInput(
            f"orientation_starts is {short_repr(orientation_starts)}, expected a tuple of first columns, "
            "such as (3,)"
        )
    matrix = np.zeros((*v.shape, E)) + np.eye(E)
    for _, tangent_columns, is_orientation in tangent_slices(E + len(orientation_starts), orientation_starts):
        if is_orientation:
            matrix[..., tangent_columns, tangent_columns] = block(v[..., tangent_columns])
    return matrix
