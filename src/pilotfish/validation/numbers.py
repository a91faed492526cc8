"""Bounded numbers: single values and arrays from outside, checked for kind, finiteness and size."""

import math

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation.text import short_repr

LARGEST_MAGNITUDE = 1e100  # the squares of such numbers, and sums of many squares, do not overflow
MOST_DIMENSIONS = 32  # of an array, as NumPy 1 has it


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
    if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
        raise InvalidInput(f"{place} is {short_repr(value)}, expected a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
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
        InvalidInput: If it is ragged, holds text, objects, complex or boolean values, or has masked entries.
    """
    _refuse_odd_items(value, place, depth=0)
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InvalidInput(f"{place} has rows of different lengths, expected equal ones: {error}") from error
    if array.dtype.kind not in "fiu":
        what = "rows of different lengths or things" if array.dtype.kind == "O" else f"{array.dtype} values"
        raise InvalidInput(f"{place} has {what} that are no real numbers, expected an array of real numbers")
    numbers = np.array(array, dtype=np.float64, order="C")
    numbers.setflags(write=False)
    return numbers


def _refuse_odd_items(value: object, place: str, depth: int) -> None:
    """Raise InvalidInput where NumPy would convert text, booleans or masked values among numbers.

    One long text among many short items would also make NumPy reserve its length for each of them.
    """
    if np.ma.is_masked(value):
        raise InvalidInput(f"{place} has masked entries, expected numbers everywhere; fill or cut them")
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


def finite_array(value: object, place: str) -> Float[Array, "..."]:
    """Return a read-only float64 copy of an array of finite numbers.

    Args:
        value: An array, or nested lists of numbers.
        place: What the value is, as the user knows it; the message begins with it.

    Raises:
        InvalidInput: As `numeric_array`, and if a value is not finite; the message names the first.
    """
    numbers = numeric_array(value, place)
    if (bad := np.argwhere(~np.isfinite(numbers))).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{place}{index} is {numbers[tuple(index)]}, nor are {len(bad) - 1} more finite")
    return numbers
