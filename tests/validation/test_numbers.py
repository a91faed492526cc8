"""Bounded numbers: values in range are returned unchanged, all others are refused with a one-line message."""

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
    require_type,
    short_repr,
)

HUGE = 10**5000


@given(st.integers(-100, 200))
def test_require_count_integer_accepts_range_only(value: int) -> None:
    if 2 <= value <= 90:
        assert require_count(value, "steps", 90, 2) == value
        return
    with pytest.raises(InvalidInput, match=rf"^steps is {value}, expected a whole number from 2 to 90$"):
        require_count(value, "steps", 90, 2)


def test_require_count_numpy_integer_returns_int() -> None:
    assert type(require_count(np.uint8(7), "steps", 90)) is int


@pytest.mark.parametrize(
    "value",
    [True, 3.0, "3", None, [3], np.array([3]), np.ma.masked, nan, HUGE, -HUGE, np.float64(3)],
    ids=short_repr,
)
def test_require_count_other_type_or_size_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^steps is .*expected a whole number"):
        require_count(value, "steps", 90)


@given(st.floats() | st.floats(-4.0, 8.0))
def test_require_number_float_accepts_range_only(value: float) -> None:
    if -1.5 <= value <= 4.0:
        assert require_number(value, "tying", -1.5, 4.0) == value
        return
    with pytest.raises(InvalidInput, match=r"^tying is .*, expected a number from -1.5 to 4$"):
        require_number(value, "tying", -1.5, 4.0)


@pytest.mark.parametrize(
    "value", [True, "3", None, [3.0], 1j, nan, inf, -inf, HUGE, -HUGE, 1e101], ids=short_repr
)
def test_require_number_other_type_or_size_is_refused(value: object) -> None:
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
def test_numeric_array_other_values_are_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^A "):
        numeric_array(value, "A")


def test_numeric_array_one_long_text_reserves_no_memory() -> None:
    with pytest.raises(InvalidInput, match=r"^A holds 'xxx"):  # NumPy would reserve 400 GB
        numeric_array(["x" * 10**6, *["y"] * 10**5], "A")


def test_numeric_array_recursive_list_is_refused() -> None:
    nested: list[object] = []
    nested.append(nested)
    with pytest.raises(InvalidInput, match="nested deeper"):
        numeric_array(nested, "A")


@given(st.lists(st.floats(allow_nan=True) | st.integers(-(2**40), 2**40)))
def test_numeric_array_numbers_returns_read_only_copy(values: list[float]) -> None:
    array = numeric_array(values, "A")
    np.testing.assert_array_equal(array, np.array(values, dtype=np.float64))
    assert not array.flags.writeable


def test_numeric_array_changed_input_keeps_copy() -> None:
    given_array = np.zeros(3)
    array = numeric_array(given_array, "A")
    given_array[0] = 1.0
    assert array[0] == 0.0


@given(st.lists(st.floats(), min_size=1))
def test_finite_array_unusable_values_names_first(values: list[float]) -> None:
    bad = [n for n, value in enumerate(values) if not abs(value) <= 1e100]
    if not bad:
        np.testing.assert_array_equal(finite_array(values, "A"), values)
        return
    with pytest.raises(InvalidInput, match=rf"^A\[{bad[0]}\] is .*\({len(bad)} such values\)"):
        finite_array(values, "A")


def test_numeric_array_integer_beyond_64_bits_is_accepted() -> None:
    assert numeric_array([10**30, -1], "A").tolist() == [1e30, -1.0]


@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e101, np.longdouble("1e400")])
def test_finite_and_float_array_unusable_value_is_named_with_index(bad: object) -> None:
    for check in (finite_array, float_array):
        with pytest.raises(InvalidInput, match=r"^A\[1, 0\] is .*\(1 such values\)"):
            check([[0.0, 1.0], [bad, 2.0]], "A")


def test_finite_and_float_array_other_shape_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"^A has shape \(2,\), expected \(3,\)"):
        finite_array([1.0, 2.0], "A", (3,))
    with pytest.raises(InvalidInput, match=r"^A has shape \(2,\), expected \(..., 3\)"):
        float_array([1.0, 2.0], "A", 3)


@pytest.mark.parametrize("value", [3, np.int64(3), np.uint8(3), np.array(3)], ids=repr)
def test_require_count_and_number_numpy_integer_returns_python_number(value: object) -> None:
    assert (require_count(value, "n", 7), type(require_count(value, "n", 7))) == (3, int)
    assert (require_number(value, "n"), type(require_number(value, "n"))) == (3.0, float)


@given(st.lists(st.floats(), min_size=1, max_size=20))
def test_float_array_float64_returns_same_array_or_refuses(values: list[float]) -> None:
    array = np.array(values)
    if all(abs(value) <= 1e100 for value in values):
        assert float_array(array, "A") is array
        return
    with pytest.raises(InvalidInput, match=r"^A\[[0-9]+\] is "):
        float_array(array, "A")


def test_numeric_array_signalling_nan_becomes_nan_without_warning() -> None:
    signalling = np.frombuffer(b"\x01\x00\x80\x7f" * 16, dtype="<f4")
    assert np.isnan(numeric_array(signalling, "x")).all()


def test_require_type_other_type_names_types_and_fix() -> None:
    require_type(1.0, "x", (int, float), "pass a number")
    with pytest.raises(InvalidInput, match=r"^x has type str, expected int or float; pass a number$"):
        require_type("1", "x", (int, float), "pass a number")


@pytest.mark.parametrize("value", [True, int], ids=repr)
def test_require_type_bool_or_class_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match=r"^x has type (bool|type), expected int; pass a number$"):
        require_type(value, "x", int, "pass a number")
