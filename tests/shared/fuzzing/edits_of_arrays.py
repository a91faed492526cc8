"""Seeded edits of arrays: entries, shape and kind of number."""

from collections.abc import Callable
from random import Random

import numpy as np

from pilotfish.types import Array

ENTRIES = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    2.0,
    0.5,
    -5.0,
    1e3,
    1e6,
    1e9,
    1e-3,
    1e-9,
    1e-154,
    1e-300,
    5e-324,
    1e16,
    1e50,
)
EXTREMES = (1e99, 1e101, 1e150, 1e155, 1e200, 1e308, -1e308, float("nan"), float("inf"), float("-inf"))
KINDS = ("<f4", ">f8", "<i8", "<c16", "|b1", "<f2", "<u1", "<U3", "<M8[s]", "<i4")


def edit_array(array: Array, rng: Random) -> tuple[Array, str]:
    """Edit entries, shape or kind of an array."""
    array = np.asarray(array)
    return rng.choice((_entries, _entries, _entries, _scaled, _scaled, _row, _shape, _shape, _kind))(
        array, rng
    )


def _entries(array: Array, rng: Random) -> tuple[Array, str]:
    if array.size == 0 or array.dtype.kind not in "fiu":
        return _shape(array, rng)
    value, n = rng.choice(ENTRIES if rng.random() < 0.6 else EXTREMES), rng.randrange(array.size)
    edited = np.array(array, dtype=np.float64)
    if rng.random() < 0.15:
        edited[...] = value
        return edited, f"all = {value}"
    edited.flat[n] = value
    return edited, f"flat[{n}] = {value}"


def _scaled(array: Array, rng: Random) -> tuple[Array, str]:
    if array.dtype.kind not in "fiu":
        return _kind(array, rng)
    factor = rng.choice((-1.0, 0.0, 1e-20, 1e20, 1e-150, 1e150, 1.0000001, *[10.0 ** rng.uniform(-9, 9)] * 7))
    with np.errstate(all="ignore"):
        return array * factor, f"times {factor}"


def _row(array: Array, rng: Random) -> tuple[Array, str]:
    if array.ndim == 0 or len(array) == 0:
        return _shape(array, rng)
    n, m = rng.randrange(len(array)), rng.randrange(len(array))
    edited = array.copy()
    edited[n] = array[m]
    return edited, f"row {n} = row {m}"


def _shape(array: Array, rng: Random) -> tuple[Array, str]:
    flat = array.reshape(-1)
    few = tuple(rng.choice((0, 1, 2, 3)) for _ in range(rng.randrange(5)))
    shapes: tuple[Callable[[], Array], ...] = (
        lambda: array[1:] if array.ndim else array[None],
        lambda: array[..., :-1] if array.ndim else array,
        lambda: array[None],
        lambda: array[..., None],
        lambda: array.T,
        lambda: array[:0] if array.ndim else flat[:0],
        lambda: np.concatenate([array, array]) if array.ndim else array,
        lambda: np.concatenate([array, array], axis=-1) if array.ndim else array,
        lambda: flat,
        lambda: np.resize(array, few) if array.size else np.zeros(few),
        lambda: np.resize(array, (100, 100)) if rng.random() < 0.1 and array.size else array[::-1],
    )
    edited = rng.choice(shapes)() if array.ndim else np.resize(array, few)
    return edited, f"shape {array.shape} -> {edited.shape}"


def _kind(array: Array, rng: Random) -> tuple[Array, str]:
    kind = np.dtype(rng.choice(KINDS))
    with np.errstate(all="ignore"):
        return (array.astype(kind) if array.dtype.kind in "fiub" else array), f"kind {kind}"
