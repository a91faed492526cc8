"""R^n x S^3 x ...: rows in which some columns, four by four, are unit quaternions, and their tangent spaces.

turns holds the first column of each quaternion. A tangent vector has three columns where its point has four:
a rotation vector [rad] in the axes of the turned body, so that x = base exp(v / 2) on an orientation and
x = base + v elsewhere. Turning the world leaves body axes alone. q and -q are one orientation.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry.quaternions import hamilton_product, quaternion_exp, rotation_matrix
from pilotfish.geometry.rotation_vectors import (
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
    """Columns of points and of tangent vectors that belong together, and whether they are an orientation."""
    try:
        return iter(_tangent_slices(width, orientation_starts))
    except TypeError:  # one of turns cannot be hashed
        require_orientation_starts(width, orientation_starts)
        raise


@lru_cache(maxsize=256)  # a fit asks for the same ones thousands of times
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
    """Return how many columns tangent vectors have at points of so many.    Raises: as require_turns."""
    require_orientation_starts(width, orientation_starts)
    return width - len(orientation_starts)


def require_orientation_starts(width: object, orientation_starts: object) -> None:
    """Check that each of turns is the first of four columns among width, none of them shared.

    Raises:
        InvalidInput: If not.
    """
    columns = require_count(width, "width", MAX_WIDTH)
    if not isinstance(orientation_starts, tuple):
        raise InvalidInput(
            f"orientation_starts is {short_repr(orientation_starts)}, expected a tuple of first columns, such as (3,)"
        )
    end = 0
    for start in sorted(require_count(turn, "orientation_starts", columns) for turn in orientation_starts):
        if start < end or start + 4 > columns:
            raise InvalidInput(
                f"orientation_starts is {short_repr(orientation_starts)}, expected first columns of quaternions, four columns each and "
                f"none shared, among {columns}"
            )
        end = start + 4


def log_map(
    base: Float[Array, "*#B D"], x: Float[Array, "*#B D"], orientation_starts: tuple[int, ...]
) -> Float[Array, "*B E"]:
    """The tangent vector at base whose geodesic reaches x: x - base, and 2 log(base* x) on orientations.

    Of x and -x the nearer one, so no rotation vector is longer than pi.
    """
    base = float_array(base, "base")
    x = float_array(x, "x", _width(base, "base"))
    require_shapes_agree(base=base, x=x)
    parts = [
        relative_rotation_vector(base[..., columns], x[..., columns])
        if turn
        else x[..., columns] - base[..., columns]
        for columns, _, turn in tangent_slices(base.shape[-1], orientation_starts)
    ]
    return np.concatenate(parts, axis=-1)


def exp_map(
    base: Float[Array, "*#B D"], v: Float[Array, "*#B E"], orientation_starts: tuple[int, ...]
) -> Float[Array, "*B D"]:
    """Where the geodesic that leaves base along v is at time one: base + v, and base exp(v / 2) on turns."""
    base = float_array(base, "base")
    v = float_array(v, "v", tangent_dimension(_width(base, "base"), orientation_starts))
    require_shapes_agree(base=base, v=v)
    parts = [
        hamilton_product(base[..., columns], quaternion_exp(0.5 * v[..., tangent_columns]))
        if turn
        else base[..., columns] + v[..., tangent_columns]
        for columns, tangent_columns, turn in tangent_slices(base.shape[-1], orientation_starts)
    ]
    return np.concatenate(parts, axis=-1)


def parallel_transport(
    d: Float[Array, "*B E"], orientation_starts: tuple[int, ...]
) -> Float[Array, "*B E E"]:
    """The matrix that carries tangent vectors at a point to exp_at(point, d), parallel along the geodesic.

    In body axes a turn by minus half of d on each orientation: the axes themselves turn by all of d.
    Source: do Carmo 1992, Riemannian Geometry, for the sphere; the bi-invariant metric of its group.
    """
    return _block_diagonal(d, orientation_starts, lambda v: rotation_matrix(quaternion_exp(-0.25 * v)))


def exp_map_jacobian(v: Float[Array, "*B E"], orientation_starts: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """J with exp_at(base, v + h) = exp_at(exp_at(base, v), J h) to first order in h; J v = v.

    See right_jacobian; the identity off the orientations.
    """
    return _block_diagonal(v, orientation_starts, right_jacobian)


def log_map_jacobian(v: Float[Array, "*B E"], orientation_starts: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """The inverse of differential: how v = log_at(base, x) changes when x moves along a tangent vector."""
    return _block_diagonal(v, orientation_starts, inverse_right_jacobian)


def karcher_mean(
    x: Float[Array, "N D"], weights: Float[Array, " N"], orientation_starts: tuple[int, ...]
) -> Float[Array, " D"]:
    """The point at which the tangent vectors to all x, weighted by their shares, add up to nothing.

    Signs of quaternions do not matter; the mean has w >= 0. It is the only one where all x lie within
    pi / 2 [rad] of it. Begins at the chordal mean, whose outer product is nearest to those of x.
    Source: Karcher 1977; Markley et al. 2007 for the beginning.
    """
    x, weights = float_array(x, "x"), float_array(weights, "shares")
    if x.ndim != 2 or weights.shape != x.shape[:1] or weights.min(initial=0.0) < 0.0:
        raise InvalidInput(
            f"x has shape {x.shape} and shares {weights.shape}, expected (N, D) and (N,), no share below zero"
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
        raise InvalidInput(f"{name} is one number, expected a row or rows of them")
    return int(array.shape[-1])


def _block_diagonal(
    v: Float[Array, "*B E"],
    orientation_starts: tuple[int, ...],
    block: Callable[[Float[Array, "*B 3"]], Float[Array, "*B 3 3"]],
) -> Float[Array, "*B E E"]:
    """The identity, with block(v) on the tangents of every orientation."""
    v = float_array(v, "v")
    E = _width(v, "v")
    if not isinstance(orientation_starts, tuple):
        raise InvalidInput(
            f"orientation_starts is {short_repr(orientation_starts)}, expected a tuple of first columns, such as (3,)"
        )
    matrix = np.zeros((*v.shape, E)) + np.eye(E)
    for _, tangent_columns, turn in tangent_slices(E + len(orientation_starts), orientation_starts):
        if turn:
            matrix[..., tangent_columns, tangent_columns] = block(v[..., tangent_columns])
    return matrix
