"""R^n x S^3 x ...: rows in which some columns, four by four, are unit quaternions, and their tangent spaces.

turns holds the first column of each quaternion. A tangent vector has three columns where its point has four:
a rotation vector [rad] in the axes of the turned body, so that x = base exp(v / 2) on an orientation and
x = base + v elsewhere. Turning the world leaves body axes alone. q and -q are one orientation.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry.quaternions import exp, hamilton_product, rotation_matrix
from pilotfish.geometry.rotation_vectors import inverse_right_jacobian, right_jacobian, rotation_vector
from pilotfish.types import Array, Float
from pilotfish.validation import float_array, require_count, require_shapes_agree, short_repr

LARGEST_WIDTH = 10**6  # columns
MEAN_STEPS, MEAN_PRECISION = 100, 1e-12  # rad
TINY = float(np.finfo(float).tiny)


def tangent_slices(width: int, turns: tuple[int, ...]) -> Iterator[tuple[slice, slice, bool]]:
    """Columns of points and of tangent vectors that belong together, and whether they are an orientation."""
    try:
        return iter(_tangent_slices(width, turns))
    except TypeError:  # one of turns cannot be hashed
        require_turns(width, turns)
        raise


@lru_cache(maxsize=256)  # a fit asks for the same ones thousands of times
def _tangent_slices(width: int, turns: tuple[int, ...]) -> tuple[tuple[slice, slice, bool], ...]:
    require_turns(width, turns)
    slices, done, tangent = [], 0, 0
    for start in (*sorted(turns), width):
        if start > done:
            slices.append((slice(done, start), slice(tangent, tangent + start - done), False))
            tangent += start - done
        if start < width:
            slices.append((slice(start, start + 4), slice(tangent, tangent + 3), True))
            tangent += 3
        done = start + 4
    return tuple(slices)


def tangent_width(width: int, turns: tuple[int, ...]) -> int:
    """Return how many columns tangent vectors have at points of so many.    Raises: as require_turns."""
    require_turns(width, turns)
    return width - len(turns)


def require_turns(width: object, turns: object) -> None:
    """Check that each of turns is the first of four columns among width, none of them shared.

    Raises:
        InvalidInput: If not.
    """
    columns = require_count(width, "width", LARGEST_WIDTH)
    if not isinstance(turns, tuple):
        raise InvalidInput(f"turns is {short_repr(turns)}, expected a tuple of first columns, such as (3,)")
    done = 0
    for start in sorted(require_count(turn, "a turn's first column", columns) for turn in turns):
        if start < done or start + 4 > columns:
            raise InvalidInput(
                f"turns is {short_repr(turns)}, expected first columns of quaternions, four columns each and "
                f"none shared, among {columns}"
            )
        done = start + 4


def log_at(
    base: Float[Array, "*#B D"], x: Float[Array, "*#B D"], turns: tuple[int, ...]
) -> Float[Array, "*B E"]:
    """The tangent vector at base whose geodesic reaches x: x - base, and 2 log(base* x) on orientations.

    Of x and -x the nearer one, so no rotation vector is longer than pi.
    """
    base = float_array(base, "base")
    x = float_array(x, "x", _width(base, "base"))
    require_shapes_agree(base=base, x=x)
    parts = [
        rotation_vector(base[..., here], x[..., here]) if turn else x[..., here] - base[..., here]
        for here, _, turn in tangent_slices(base.shape[-1], turns)
    ]
    return np.concatenate(parts, axis=-1)


def exp_at(
    base: Float[Array, "*#B D"], v: Float[Array, "*#B E"], turns: tuple[int, ...]
) -> Float[Array, "*B D"]:
    """Where the geodesic that leaves base along v is at time one: base + v, and base exp(v / 2) on turns."""
    base = float_array(base, "base")
    v = float_array(v, "v", tangent_width(_width(base, "base"), turns))
    require_shapes_agree(base=base, v=v)
    parts = [
        hamilton_product(base[..., here], exp(0.5 * v[..., there]))
        if turn
        else base[..., here] + v[..., there]
        for here, there, turn in tangent_slices(base.shape[-1], turns)
    ]
    return np.concatenate(parts, axis=-1)


def transport(d: Float[Array, "*B E"], turns: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """The matrix that carries tangent vectors at a point to exp_at(point, d), parallel along the geodesic.

    In body axes a turn by minus half of d on each orientation: the axes themselves turn by all of d.
    Source: do Carmo 1992, Riemannian Geometry, for the sphere; the bi-invariant metric of its group.
    """
    return _block_diagonal(d, turns, lambda v: rotation_matrix(exp(-0.25 * v)))


def differential(v: Float[Array, "*B E"], turns: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """J with exp_at(base, v + h) = exp_at(exp_at(base, v), J h) to first order in h; J v = v.

    See right_jacobian; the identity off the orientations.
    """
    return _block_diagonal(v, turns, right_jacobian)


def inverse_differential(v: Float[Array, "*B E"], turns: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """The inverse of differential: how v = log_at(base, x) changes when x moves along a tangent vector."""
    return _block_diagonal(v, turns, inverse_right_jacobian)


def karcher_mean(
    x: Float[Array, "N D"], shares: Float[Array, " N"], turns: tuple[int, ...]
) -> Float[Array, " D"]:
    """The point at which the tangent vectors to all x, weighted by their shares, add up to nothing.

    Signs of quaternions do not matter; the mean has w >= 0. It is the only one where all x lie within
    pi / 2 [rad] of it. Begins at the chordal mean, whose outer product is nearest to those of x.
    Source: Karcher 1977; Markley et al. 2007 for the beginning.
    """
    x, shares = float_array(x, "x"), float_array(shares, "shares")
    if x.ndim != 2 or shares.shape != x.shape[:1] or shares.min(initial=0.0) < 0.0:
        raise InvalidInput(
            f"x has shape {x.shape} and shares {shares.shape}, expected (N, D) and (N,), no share below zero"
        )
    require_turns(x.shape[1], turns)
    x, shares = x[shares > 0.0], shares[shares > 0.0] / max(float(shares.sum()), TINY)
    mean = shares @ x
    for start in turns:
        q = x[:, start : start + 4]
        mean[start : start + 4] = np.linalg.eigh((shares[:, None] * q).T @ q)[1][:, -1]
    for _ in range(MEAN_STEPS if turns else 0):
        step = shares @ log_at(mean, x, turns)
        mean = exp_at(mean, step, turns)
        if np.abs(step).max() < MEAN_PRECISION:
            break
    for start in turns:
        mean[start : start + 4] *= -1.0 if mean[start] < 0.0 else 1.0
    return np.asarray(mean)


def _width(array: Float[Array, "*B D"], name: str) -> int:
    if array.ndim == 0:
        raise InvalidInput(f"{name} is one number, expected a row or rows of them")
    return int(array.shape[-1])


def _block_diagonal(
    v: Float[Array, "*B E"],
    turns: tuple[int, ...],
    block: Callable[[Float[Array, "*B 3"]], Float[Array, "*B 3 3"]],
) -> Float[Array, "*B E E"]:
    """The identity, with block(v) on the tangents of every orientation."""
    v = float_array(v, "v")
    E = _width(v, "v")
    if not isinstance(turns, tuple):
        raise InvalidInput(f"turns is {short_repr(turns)}, expected a tuple of first columns, such as (3,)")
    matrix = np.zeros((*v.shape, E)) + np.eye(E)
    for _, there, turn in tangent_slices(E + len(turns), turns):
        if turn:
            matrix[..., there, there] = block(v[..., there])
    return matrix
