"""Bounded numbers: single values and arrays from outside, checked for type, finiteness and magnitude."""

import math
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation.text import short_repr

MAX_MAGNITUDE = 1e100  # squares of such numbers, and sums of many squares, do not overflow
MAX_FLOAT = float(np.finfo(np.float64).max)
MAX_DIMENSIONS = 32  # the limit of NumPy 1
MIN_PERIOD, MAX_PERIOD = 1e-9, 1e9  # s; their squares and reciprocals do not overflow
SMALL_ARRAY_SIZE = 16  # entries below which math.hypot is faster than NumPy


def require_count(value: object, label: str, maximum: int, minimum: int = 0) -> int:
    """Return value as an int if it is a whole number in a range.

    Use it for every number from outside that sizes an array or a loop.

    Args:
        value: NumPy integers are accepted, booleans and floats are not.
        label: Name of the value; the message begins with it.
        maximum: Largest accepted value.
        minimum: Smallest accepted value.

    Raises:
        InvalidInput: If it has another type or is outside the range.
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
    """Return value as a float if it is a finite real number in a range.

    Args:
        value: NumPy numbers are accepted; booleans, text and complex numbers are not.
        label: Name of the value; the message begins with it.
        minimum: Smallest accepted value. For a positive number whose square or reciprocal is used, pass a
            bound at which neither underflows nor overflows, not 0.
        maximum: Largest accepted value.

    Raises:
        InvalidInput: If it has another type, is not finite, or is outside the range.
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


def require_period(value: object, label: str = "period") -> float:
    """Return the time between two samples as a float.

    Args:
        value: Time [s], from 1e-9 to 1e9.
        label: Name of the value; the message begins with it.

    Raises:
        InvalidInput: If it is not a number in this range.
    """
    try:
        return require_number(value, label, MIN_PERIOD, MAX_PERIOD)
    except InvalidInput as error:
        raise InvalidInput(f"{error}: a positive time [s]") from error


def numeric_array(value: object, label: str) -> Float[Array, "..."]:
    """Return a read-only float64 copy of an array of real numbers, which may be NaN or infinite.

    Args:
        value: Array or nested lists of numbers.
        label: Name of the value; the message begins with it.

    Raises:
        InvalidInput: If it is ragged or contains text, dates, objects, complex, boolean or masked values, at
            any depth of its lists.
    """
    _require_real_items(value, label, depth=0)
    try:
        array = np.array(value)
        if array.dtype.kind == "O":  # an integer beyond 64 bits gives an array of objects
            array = _floats_from_objects(array)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(
            f"{label} has rows of different lengths or values that are not real numbers ({error}), expected "
            "an array of real numbers"
        ) from error
    if array.dtype.kind not in "fiu":
        raise InvalidInput(
            f"{label} has {array.dtype} values, which are not real numbers, expected an array of real "
            f"numbers: {short_repr(value)}"
        )
    if array.dtype == np.float64:
        numbers = np.ascontiguousarray(array).reshape(array.shape)
    else:  # a number too large for float64 becomes infinite, a signalling NaN becomes a quiet one
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
    """Return a read-only float64 copy of an array of finite numbers of bounded magnitude.

    Args:
        value: Array or nested lists of numbers.
        label: Name of the value; the message begins with it.
        shape: Expected shape; None accepts any.
        maximum: Largest accepted magnitude.

    Raises:
        InvalidInput: As `numeric_array`, and if the shape differs or a value is not finite or too large; the
            message gives the first such value.
    """
    numbers = numeric_array(value, label)
    if shape is not None and numbers.shape != shape:
        raise InvalidInput(f"{label} has shape {numbers.shape}, expected {shape}")
    require_bounded(numbers, label, maximum)
    return numbers


def float_array(
    value: object, label: str, columns: int | None = None, maximum: float = MAX_MAGNITUDE
) -> Float[Array, "..."]:
    """Return an array of finite numbers as float64: the same object if possible, otherwise a copy.

    For functions that are called often: the only cost is one pass over the numbers.

    Args:
        value: Array or nested lists of numbers.
        label: Name of the value; the message begins with it.
        columns: Expected length of the last axis; None accepts any shape.
        maximum: Largest accepted magnitude.

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
        return array  # NumPy takes ten times as long for one quaternion
    require_bounded(array, label, maximum)
    return array


def require_shapes_agree(**arrays: Array) -> None:
    """Check that the leading axes of arrays broadcast; the last axis is not compared.

    Args:
        arrays: Arrays by name.

    Raises:
        InvalidInput: If they do not; the message lists names and shapes.
    """
    leading = [array.shape[:-1] for array in arrays.values()]
    if any(shape != leading[0] for shape in leading):
        try:
            np.broadcast_shapes(*leading)
        except ValueError:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            raise InvalidInput(f"the shapes {shapes} do not broadcast, expected equal shapes") from None


def require_bounded(numbers: Float[Array, "..."], label: str, maximum: float = MAX_MAGNITUDE) -> None:
    """Check without a copy that float64 numbers are finite and of bounded magnitude.

    Args:
        numbers: Array to check.
        label: Name of the array; the message begins with it.
        maximum: Largest accepted magnitude.

    Raises:
        InvalidInput: If one is not; the message gives the first such value and their number.
    """
    if not np.abs(numbers).max(initial=0.0) <= min(maximum, MAX_FLOAT):  # also if the maximum is NaN
        bad = np.argwhere(~(np.abs(numbers) <= min(maximum, MAX_FLOAT)))
        index = bad[0].tolist()
        raise InvalidInput(
            f"{label}{index or ''} is {float(numbers[tuple(index)])}, expected a finite number of at most "
            f"{maximum:g} in magnitude ({len(bad)} such values)"
        )


def _require_real_items(value: object, label: str, depth: int) -> None:
    """Refuse text, booleans and masked values, which NumPy would convert.

    NumPy would also reserve the length of the longest text for every item.
    """
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise InvalidInput(f"{label} has masked entries, expected numbers only; fill or remove them")
    if isinstance(value, np.ndarray) and value.dtype == bool:
        raise InvalidInput(f"{label} has bool values, expected an array of real numbers; pass 1 and 0")
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
    """Convert an object array of Python numbers."""
    if array.size == 0 or not all(type(entry) in (int, float) for entry in array.flat):
        raise TypeError("objects")
    return np.array([float(entry) for entry in array.flat]).reshape(array.shape)


def _to_float(number: Any) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf
