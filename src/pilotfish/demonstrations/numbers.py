"""From whatever a user gives to an array of finite numbers that nobody can change."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float


def numeric_array(value: object, place: str) -> Float[Array, "..."]:
    """A read-only float64 copy; numbers may still be nan.

    Raises: InvalidInput, for ragged lists, text, complex or boolean values, and masked entries.
    """
    if np.ma.is_masked(value):
        raise InvalidInput(f"{place} has masked entries, expected numbers everywhere; fill or cut them")
    try:
        array = np.array(value)
    except ValueError as error:
        raise InvalidInput(f"{place} has rows of different lengths, expected equal ones: {error}") from error
    if array.dtype.kind not in "fiu":
        what = "rows of different lengths or things" if array.dtype.kind == "O" else f"{array.dtype} values"
        raise InvalidInput(f"{place} has {what} that are no real numbers, expected an array of real numbers")
    numbers = np.array(array, dtype=np.float64, order="C")
    numbers.setflags(write=False)
    return numbers


def finite_array(value: object, place: str) -> Float[Array, "..."]:
    """As numeric_array, and every number finite.

    Raises: InvalidInput, naming the first that is not and how many more.
    """
    numbers = numeric_array(value, place)
    if (bad := np.argwhere(~np.isfinite(numbers))).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{place}{index} is {numbers[tuple(index)]}, nor are {len(bad) - 1} more finite")
    return numbers
