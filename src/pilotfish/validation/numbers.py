"""Bounded numbers: single values and arrays from outside, checked for kind, finiteness and size."""

import math
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation.text import short_repr

MAX_MAGNITUDE = 1e100  # the squares of such numbers, and sums of many squares, do not overflow
MAX_FLOAT = float(np.finfo(np.float64).max)
MAX_DIMENSIONS = 32  # of an array, as NumPy 1 has it
SMALL_ARRAY_SIZE = 16  # numbers


def require_count(value: object, label: str, maximum: int, minimum: int = 0) -> int:
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
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a whole number")
    if not minimum <= value <= maximum:
        raise InvalidInput(
            f"{label} is {short_repr(int(value))}, expected a whole number from {minimum} to {maximum}"
        )
    return int(value)


def require_number(
    value: object, label: str, minimum: float = -MAX_MAGNITUDE, maximum: float = MAX_MAGNITUDE
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
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a number")
    number = _to_float(value)
    if not minimum <= number <= maximum:
        raise InvalidInput(
            f"{label} is {short_repr(value)}, expected a number from {minimum:g} to {maximum:g}"
        )
    return number


def numeric_array(value: object, label: str) -> Float[Array, "..."]:
    """Return a read-only float64 copy of an array of real numbers, which may be NaN or infinite.

    Args:
        value: An array, or nested lists of numbers.
        place: What the value is, as the user knows it; the message begins with it.

    Raises:
        InvalidInput: If it is ragged, holds text, dates, objects, complex or boolean values, or has masked
            entries, anywhere in its lists.
    """
    _require_real_items(value, label, depth=0)
    try:
        array = np.array(value)
        if array.dtype.kind == "O":  # a whole number beyond 64 bits makes objects of all
            array = _floats_from_objects(array)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(
            f"{label} has rows of different lengths or things that are no real numbers ({error}), expected "
            "an array of real numbers"
        ) from error
    if array.dtype.kind not in "fiu":
        raise InvalidInput(
            f"{label} has {array.dtype} values that are no real numbers, expected an array of real numbers: "
            f"{short_repr(value)}"
        )
    # A number that is too large for float64 becomes infinite, and a signalling NaN a quiet one.
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = np.array(array, dtype=np.float64, order="C")
    numbers.setflags(write=False)
    return numbers


def finite_array(
    value: object,
    label: str,
    shape: tuple[int, ...] | None = None,
    maximum: float = MAX_MAGNITUDE,
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
    numbers = numeric_array(value, label)
    if shape is not None and numbers.shape != shape:
        raise InvalidInput(f"{label} has shape {numbers.shape}, expected {shape}")
    require_bounded(numbers, label, maximum)
    return numbers


def float_array(
    value: object, label: str, columns: int | None = None, maximum: float = MAX_MAGNITUDE
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
    array = value if same else numeric_array(value, label)
    assert isinstance(array, np.ndarray)
    if columns is not None and (array.ndim == 0 or array.shape[-1] != columns):
        raise InvalidInput(f"{label} has shape {array.shape}, expected (..., {columns})")
    if (
        array.ndim == 1
        and array.size < SMALL_ARRAY_SIZE
        and math.hypot(*array.tolist()) <= maximum < math.inf
    ):
        return array  # a row such as a quaternion, for which NumPy takes ten times as long
    require_bounded(array, label, maximum)
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


def require_bounded(numbers: Float[Array, "..."], label: str, maximum: float = MAX_MAGNITUDE) -> None:
    """Check that float64 numbers are finite and from -largest to largest, without a copy.

    Raises:
        InvalidInput: If one is not; the message names the first and how many there are.
    """
    if not np.abs(numbers).max(initial=0.0) <= min(maximum, MAX_FLOAT):  # nor where the maximum is NaN
        bad = np.argwhere(~(np.abs(numbers) <= min(maximum, MAX_FLOAT)))
        index = bad[0].tolist()
        raise InvalidInput(
            f"{label}{index or ''} is {float(numbers[tuple(index)])}, expected a finite number of at most "
            f"{maximum:g} in magnitude, nor are {len(bad) - 1} more such numbers"
        )


def _require_real_items(value: object, label: str, depth: int) -> None:
    """Raise InvalidInput where NumPy would convert text, booleans or masked values among numbers.

    One long text among many short items would also make NumPy reserve its length for each of them.
    """
    if np.ma.is_masked(value):
        raise InvalidInput(f"{label} has masked entries, expected numbers everywhere; fill or cut them")
    if isinstance(value, np.ndarray) and value.dtype == bool:
        raise InvalidInput(f"{label} holds bool values, expected an array of real numbers; give 1 and 0")
    if not isinstance(value, list | tuple):
        return
    if depth == MAX_DIMENSIONS:
        raise InvalidInput(f"{label} is nested deeper than {MAX_DIMENSIONS} lists, expected an array")
    for item in value:
        if type(item) is float or type(item) is int:
            continue
        if isinstance(item, str | bytes | bool | np.bool_):
            raise InvalidInput(f"{label} holds {short_repr(item)}, expected an array of real numbers")
        _require_real_items(item, label, depth + 1)


def _floats_from_objects(array: Array) -> Array:
    """The numbers of an object array, where all are real and float64 holds them."""
    if array.size == 0 or not all(type(entry) in (int, float) for entry in array.flat):
        raise TypeError("objects")
    return np.array([float(entry) for entry in array.flat]).reshape(array.shape)


def _to_float(number: Any) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf
