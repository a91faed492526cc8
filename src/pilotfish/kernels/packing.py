"""Packing of array arguments for the compiled kernels, with checks of their shapes and domains."""

from contextlib import suppress
from dataclasses import replace
from math import inf
from typing import Any, TypeVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, short_repr

MAX_NUMBER = 1e150  # sums of squares do not overflow
MAX_EXACT_INTEGER = 2**53  # float64 represents every integer up to here
MAX_INT = 2**31 - 1
EMPTY_AXES = "N"  # axes that may have size 0

# An array argument of a kernel: its name, its axes and its domain. Axes are a letter each, equal letters for
# equal sizes, or a digit for a fixed size. Domains: "finite" (at most MAX_NUMBER in magnitude), "probability"
# (at least 0, finite), "logarithm" (below +inf) and "any" (NaN and infinities have a meaning).
ArgumentSpec = tuple[str, str, str]

Dataclass = TypeVar("Dataclass")


def pack_arguments(
    arguments: tuple[ArgumentSpec, ...], values: tuple[object, ...], sizes: dict[str, int]
) -> list[Array]:
    """Return the values packed for the compiled kernels.

    Args:
        arguments: Specification of each value.
        values: Arrays or nested lists of numbers.
        sizes: Known sizes of axes; those of the values are added.

    Raises:
        InvalidInput: If a value is not an array of real numbers, or its shape or domain is wrong.
    """
    arrays = []
    for (name, axes, domain), value in zip(arguments, values, strict=True):
        array = pack_array(value, name)
        if not _shape_matches(axes, array.shape, sizes):
            raise _shape_error(name, axes, array, sizes)
        if domain != "any" and array.size and not _in_domain(domain, array):
            raise _domain_error(name, domain, array)
        arrays.append(array)
    return arrays


def pack_array(value: object, name: str) -> Float[Array, "..."]:
    """Return value itself if the compiled kernels can read it in place, else a packed copy."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        flags = value.flags
        if flags.c_contiguous and flags.aligned and value.dtype.isnative:
            return value
    return numeric_array(value, name)


def _shape_matches(axes: str, shape: tuple[int, ...], sizes: dict[str, int]) -> bool:
    if len(axes) != len(shape):
        return False
    for axis, size in zip(axes, shape, strict=True):
        expected_size = int(axis) if axis.isdigit() else sizes.setdefault(axis, size)
        if size != expected_size or (size == 0 and axis not in EMPTY_AXES):
            return False
    return True


def _shape_error(name: str, axes: str, array: Array, sizes: dict[str, int]) -> InvalidInput:
    known = ", ".join(f"{axis} = {size}" for axis, size in sizes.items() if axis in axes and size)
    expected = f"({', '.join(axes)})" + (f" with {known}" if known else "")
    return InvalidInput(f"{name} has shape {array.shape}, expected {expected}")


def _in_domain(domain: str, array: Array) -> bool:
    match domain:
        case "finite":
            return bool(np.abs(array).max() <= MAX_NUMBER)
        case "probability":
            return bool(array.min() >= 0.0 and array.max() < inf)
        case _:
            return bool(array.max() < inf)  # false for NaN too


def _domain_error(name: str, domain: str, array: Array) -> InvalidInput:
    good, expected = {
        "finite": (np.abs(array) <= MAX_NUMBER, f"finite numbers of at most {MAX_NUMBER:g}"),
        "probability": ((array >= 0.0) & (array < inf), "finite numbers of at least 0"),
        "logarithm": (array < inf, "logarithms: finite numbers or -inf"),
    }[domain]
    index = np.argwhere(~good)[0].tolist()
    return InvalidInput(f"{name}{index} is {array[tuple(index)]}, expected {expected}")


def pack_fields(value: Dataclass, arguments: tuple[ArgumentSpec, ...], sizes: dict[str, int]) -> Dataclass:
    """Return the dataclass with some of its arrays packed.

    Args:
        value: Instance of a dataclass.
        arguments: Specification of each of these arrays.
        sizes: Known sizes of axes; those of the arrays are added.
    """
    names = [name for name, _, _ in arguments]
    originals = [getattr(value, name) for name in names]
    arrays = pack_arguments(arguments, tuple(originals), sizes)
    if all(array is original for array, original in zip(arrays, originals, strict=True)):
        return value
    packed: dict[str, Any] = dict(zip(names, arrays, strict=True))
    return replace(value, **packed)  # type: ignore[type-var]  # every value is a dataclass


def require_real(value: object, name: str) -> float:
    """Return a real number as a float.

    Args:
        value: Number.
        name: Its name in errors.
    """
    if isinstance(value, int | float | np.integer | np.floating):
        with suppress(OverflowError):
            return float(value)
    raise InvalidInput(f"{name} is {short_repr(value)}, expected a number within the range of float64")
