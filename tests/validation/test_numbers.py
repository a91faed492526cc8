"""Bounded numbers: what is in range passes unchanged, everything else is refused in one line."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import InvalidInput
from pilotfish.validation import (
    finite_array,
    float_array,
    numeric_array,
    require_count,
    require_number,
    short_repr,
)

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
    "value",
    [True, 3.0, "3", None, [3], np.array([3]), np.ma.masked, nan, HUGE, -HUGE, np.float64(3)],
    ids=short_repr,
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
        True,
        [np.array([True]), np.array([1.0])],
        np.ma.masked,
        [np.ma.masked, 1.0],
        np.zeros(2, dtype=[("x", float)]),
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
def test_finite_array_names_the_first_value_that_is_not_finite_or_too_large(values: list[float]) -> None:
    bad = [n for n, value in enumerate(values) if not abs(value) <= 1e100]
    if not bad:
        np.testing.assert_array_equal(finite_array(values, "A"), values)
        return
    with pytest.raises(InvalidInput, match=rf"^A\[{bad[0]}\] is .*{len(bad) - 1} more"):
        finite_array(values, "A")


def test_whole_number_beyond_64_bits_is_a_number() -> None:
    assert numeric_array([10**30, -1], "A").tolist() == [1e30, -1.0]


@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e101, np.longdouble("1e400")])
def test_unusable_number_is_named_with_its_place(bad: object) -> None:
    for check in (finite_array, float_array):
        with pytest.raises(InvalidInput, match=r"^A\[1, 0\] is .*, nor are 0 more"):
            check([[0.0, 1.0], [bad, 2.0]], "A")


def test_array_of_another_shape_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"^A has shape \(2,\), expected \(3,\)"):
        finite_array([1.0, 2.0], "A", (3,))
    with pytest.raises(InvalidInput, match=r"^A has shape \(2,\), expected \(..., 3\)"):
        float_array([1.0, 2.0], "A", 3)


@pytest.mark.parametrize("value", [3, np.int64(3), np.uint8(3), np.array(3)], ids=repr)
def test_whole_number_of_numpy_is_a_count_and_a_number(value: object) -> None:
    assert (require_count(value, "n", 7), type(require_count(value, "n", 7))) == (3, int)
    assert (require_number(value, "n"), type(require_number(value, "n"))) == (3.0, float)


@given(st.lists(st.floats(), min_size=1, max_size=20))
def test_float_array_returns_the_same_array_or_refuses_it(values: list[float]) -> None:
    array = np.array(values)
    if all(abs(value) <= 1e100 for value in values):
        assert float_array(array, "A") is array
        return
    with pytest.raises(InvalidInput, match=r"^A\[[0-9]+\] is "):
        float_array(array, "A")


def test_signalling_nan_of_single_precision_becomes_nan_without_a_warning() -> None:
    signalling = np.frombuffer(b"\x01\x00\x80\x7f" * 16, dtype="<f4")
    assert np.isnan(numeric_array(signalling, "x")).all()
