"""Bounded numbers: what is in range passes unchanged, everything else is refused in one line."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import InvalidInput
from pilotfish.validation import finite_array, numeric_array, require_count, require_number, short_repr

HUGE = 10**5000


@given(st.integers(-100, 200))
def test_count_passes_exactly_between_its_bounds(value: int) -> None:
    if 2 <= value <= 90:
        assert require_count(value, "steps", 90, 2) == value
        return
    with pytest.raises(InvalidInput, match=rf"^steps is {value}, expected a whole number from 2 to 90$"):
        require_count(value, "steps", 90, 2)


def test_count_of_numpy_becomes_an_int() -> None:
    assert type(require_count(np.uint8(7), "steps", 90)) is int


@pytest.mark.parametrize(
    "value", [True, 3.0, "3", None, [3], nan, HUGE, -HUGE, np.float64(3)], ids=short_repr
)
def test_count_of_another_kind_or_size_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^steps is .*expected a whole number"):
        require_count(value, "steps", 90)


@given(st.floats() | st.floats(-4.0, 8.0))
def test_number_passes_exactly_between_its_bounds(value: float) -> None:
    if -1.5 <= value <= 4.0:
        assert require_number(value, "tying", -1.5, 4.0) == value
        return
    with pytest.raises(InvalidInput, match=r"^tying is .*, expected a number from -1.5 to 4$"):
        require_number(value, "tying", -1.5, 4.0)


@pytest.mark.parametrize(
    "value", [True, "3", None, [3.0], 1j, nan, inf, -inf, HUGE, -HUGE, 1e101], ids=short_repr
)
def test_number_of_another_kind_or_size_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^tying is "):
        require_number(value, "tying")


@pytest.mark.parametrize(
    "value",
    [
        ["3", 1.0],
        [b"3"],
        [[1.0], ["x" * 10**6]],
        [True, 1.0],
        [np.True_, 2],
        np.array([True]),
        [1j],
        [None],
        [[1.0, 2.0], [3.0]],
        [HUGE, 1.0],
        HUGE,
        {1.0},
        np.ma.array([1.0, 2.0], mask=[False, True]),
        [np.ma.array([1.0, 2.0], mask=[False, True])],
        np.array(["2001-01-01"], dtype="datetime64[D]"),
    ],
    ids=short_repr,
)
def test_array_of_other_than_numbers_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^A "):
        numeric_array(value, "A")


def test_one_long_text_among_many_items_reserves_no_memory() -> None:
    with pytest.raises(InvalidInput, match=r"^A holds 'xxx"):  # NumPy would reserve 400 GB
        numeric_array(["x" * 10**6, *["y"] * 10**5], "A")


def test_list_nested_without_end_is_refused() -> None:
    nested: list[object] = []
    nested.append(nested)
    with pytest.raises(InvalidInput, match="nested deeper"):
        numeric_array(nested, "A")


@given(st.lists(st.floats(allow_nan=True) | st.integers(-(2**40), 2**40)))
def test_array_of_numbers_is_a_read_only_copy(values: list[float]) -> None:
    array = numeric_array(values, "A")
    np.testing.assert_array_equal(array, np.array(values, dtype=np.float64))
    assert not array.flags.writeable


def test_array_given_is_copied() -> None:
    given_array = np.zeros(3)
    array = numeric_array(given_array, "A")
    given_array[0] = 1.0
    assert array[0] == 0.0


@given(st.lists(st.floats(), min_size=1))
def test_finite_array_names_the_first_value_that_is_not_finite(values: list[float]) -> None:
    bad = [n for n, value in enumerate(values) if not np.isfinite(value)]
    if not bad:
        np.testing.assert_array_equal(finite_array(values, "A"), values)
        return
    with pytest.raises(InvalidInput, match=rf"^A\[{bad[0]}\] is .*{len(bad) - 1} more"):
        finite_array(values, "A")
