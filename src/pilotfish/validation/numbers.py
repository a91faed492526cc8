"""Bounded numbers: single values and arrays from outside, checked for kind, finiteness and size."""

import math
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation.text import short_repr

LARGEST_MAGNITUDE = 1e100  # the squares of such numbers, and sums of many squares, do not overflow
LARGEST_FLOAT = float(np.finfo(np.float64).max)
MOST_DIMENSIONS = 32  # of an array, as NumPy 1 has it
FEW = 16  # numbers


def require_count(value: object, place: str, largest: int, lowest: int = 0) -> int:
    """Return value as an int if it is a whole number from lowest to largest.

    Every number that sizes an array or a loop and comes from outside passes here.

    Args:
        value: The number; NumPy integers are accepted, booleans and floats are not.
        place: What the value is, as the user knows it; the message begins with it.
        largest: Largest accepted value.
        lowest: Smallest accepted value.

    Raises:
        InvalidInput: If it is another kind of value or outside the range.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.is_masked(value):
        value = value[()]
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        raise InvalidInput(f"{place} is {short_repr(value)}, expected a whole number")
    if not lowest <= value <= largest:
        raise InvalidInput(
            f"{place} is {short_repr(int(value))}, expected a whole number from {lowest} to {largest}"
        )
    return int(value)


def require_number(
    value: object, place: str, lowest: float = -LARGEST_MAGNITUDE, largest: float = LARGEST_MAGNITUDE
) -> float:
    """Return value as a float if it is a finite real number from lowest to largest.

    Args:
        value: The number; NumPy numbers are accepted, booleans, text and complex numbers are not.
        place: What the value is, as the user knows it; the message begins with it.
        lowest: Smallest accepted value. For a positive number whose square or reciprocal is used, pass
            a bound at which neither underflows nor overflows, not 0.
        largest: Largest accepted value.

    Raises:
        InvalidInput: If it is another kind of value, not finite, or outside the range.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.is_masked(value):
        value = value[()]
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        raise InvalidInput(f"{place} is {short_repr(value)}, expected a number")
    number = _float(value)
    if not lowest <= number <= largest:
        raise InvalidInput(
            f"{place} is {short_repr(value)}, expected a number from {lowest:g} to {largest:g}"
        )
    return number


def numeric_array(value: object, place: str) -> Float[Array, "..."]:
    """Return a read-only float64 copy of an array of real numbers, which may be NaN or infinite.

    Args:
        value: An array, or nested lists of numbers.
        place: What the value is, as the user knows it; the message begins with it.

    Raises:
        InvalidInput: If it is ragged, holds text, dates, objects, complex or boolean values, or has masked
            entries, anywhere in its lists.
    """
    _refuse_odd_items(value, place, depth=0)
    try:
        array = np.array(value)
        if array.dtype.kind == "O":  # a whole number beyond 64 bits makes objects of all
            array = _floats_of_objects(array)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(
            f"{place} has rows of different lengths or things that are no real numbers ({error}), expected "
            "an array of real numbers"
        ) from error
    if array.dtype.kind not in "fiu":
        raise InvalidInput(
            f"{place} has {array.dtype} values that are no real numbers, expected an array of real numbers: "
            f"{short_repr(value)}"
        )
    # A number that is too large for float64 becomes infinite, and a signalling NaN a quiet one.
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = np.array(array, dtype=np.float64, order="C")
    numbers.setflags(write=False)
    return numbers


def finite_array(
    value: object,
    place: str,
    shape: tuple[int, ...] | None = None,
    largest: float = LARGEST_MAGNITUDE,
) -> Float[Array, "..."]:
    """Return a read-only float64 copy of an array of finite numbers from -largest to largest.

    Args:
        value: An array, or nested lists of numbers.
        place: What the value is, as the user knows it; the message begins with it.
        shape: The shape it must have; None accepts any.
        largest: Largest accepted magnitude.

    Raises:
        InvalidInput: As `numeric_array`, and if it has another shape or a value that is not finite or
            larger; the message names the first.
    """
    numbers = numeric_array(value, place)
    if shape is not None and numbers.shape != shape:
        raise InvalidInput(f"{place} has shape {numbers.shape}, expected {shape}")
    refuse_huge(numbers, place, largest)
    return numbers


def float_array(
    value: object, place: str, columns: int | None = None, largest: float = LARGEST_MAGNITUDE
) -> Float[Array, "..."]:
    """Return an array of finite numbers as float64: the same object if it is one already, else a copy.

    For functions that are called often: one pass over the numbers, nothing else.

    Args:
        value: An array, or nested lists of numbers.
        place: What the value is, as the user knows it; the message begins with it.
        columns: How many numbers the last axis must have; None accepts any number and any shape.
        largest: Largest accepted magnitude.

    Raises:
        InvalidInput: As `finite_array`, and if the last axis is missing or has another length.
    """
    same = type(value) is np.ndarray and value.dtype == np.float64
    array = value if same else numeric_array(value, place)
    assert isinstance(array, np.ndarray)
    if columns is not None and (array.ndim == 0 or array.shape[-1] != columns):
        raise InvalidInput(f"{place} has shape {array.shape}, expected (..., {columns})")
    if array.ndim == 1 and array.size < FEW and math.hypot(*array.tolist()) <= largest < math.inf:
        return array  # a row such as a quaternion, for which NumPy takes ten times as long
    refuse_huge(array, place, largest)
    return array


def require_shapes_agree(**arrays: Array) -> None:
    """Check that arrays have leading axes that broadcast; the last axis is not compared.

    Raises:
        InvalidInput: If they do not; the message names the arrays and their shapes.
    """
    leading = [array.shape[:-1] for array in arrays.values()]
    if any(shape != leading[0] for shape in leading):
        try:
            np.broadcast_shapes(*leading)
        except ValueError:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            raise InvalidInput(f"the shapes {shapes} do not go together, expected equal ones") from None


def refuse_huge(numbers: Float[Array, "..."], place: str, largest: float = LARGEST_MAGNITUDE) -> None:
    """Check that float64 numbers are finite and from -largest to largest, without a copy.

    Raises:
        InvalidInput: If one is not; the message names the first and how many there are.
    """
    if not np.abs(numbers).max(initial=0.0) <= min(largest, LARGEST_FLOAT):  # nor where the maximum is NaN
        bad = np.argwhere(~(np.abs(numbers) <= min(largest, LARGEST_FLOAT)))
        index = bad[0].tolist()
        raise InvalidInput(
            f"{place}{index or ''} is {float(numbers[tuple(index)])}, expected a finite number of at most "
            f"{largest:g} in magnitude, nor are {len(bad) - 1} more such numbers"
        )


def _refuse_odd_items(value: object, place: str, depth: int) -> None:
    """Raise InvalidInput where NumPy would convert text, booleans or masked values among numbers.

    One long text among many short items would also make NumPy reserve its length for each of them.
    """
    if np.ma.is_masked(value):
        raise InvalidInput(f"{place} has masked entries, expected numbers everywhere; fill or cut them")
    if isinstance(value, np.ndarray) and value.dtype == bool:
        raise InvalidInput(f"{place} holds bool values, expected an array of real numbers; give 1 and 0")
    if not isinstance(value, list | tuple):
        return
    if depth == MOST_DIMENSIONS:
        raise InvalidInput(f"{place} is nested deeper than {MOST_DIMENSIONS} lists, expected an array")
    for item in value:
        if type(item) is float or type(item) is int:
            continue
        if isinstance(item, str | bytes | bool | np.bool_):
            raise InvalidInput(f"{place} holds {short_repr(item)}, expected an array of real numbers")
        _refuse_odd_items(item, place, depth + 1)


def _floats_of_objects(array: Array) -> Array:
    """The numbers of an object array, where all are real and float64 holds them."""
    if array.size == 0 or not all(type(entry) in (int, float) for entry in array.flat):
        raise TypeError("objects")
    return np.array([float(entry) for entry in array.flat]).reshape(array.shape)


def _float(number: Any) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf
