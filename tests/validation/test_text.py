"""Printable text: bounded, printable and fast for any input."""

from time import process_time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import MAX_MESSAGE_LENGTH, InvalidInput, SkillError, escape
from pilotfish.validation import (
    MAX_NAME_LENGTH,
    first_duplicate,
    require_printable,
    short_list,
    short_repr,
)

ANY_TEXT = st.text(st.characters(), max_size=2000)  # control characters and lone surrogates too
SCALARS = (
    st.none() | st.booleans() | st.integers() | st.floats() | ANY_TEXT | st.binary() | st.complex_numbers()
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(ANY_TEXT, inner),
    max_leaves=20,
)
HUGE = 10**5000  # more digits than Python prints
MAX_SECONDS = 2.0  # s of CPU time; building repr of 10^6 entries and every copy of it takes much longer


@given(ANY_TEXT)
def test_escape_any_text_is_printable_and_encodes(text: str) -> None:
    escaped = escape(text)
    assert escaped.isprintable()
    escaped.encode("utf-8")


@given(st.text(st.characters(categories=("L", "N", "P", "S"))))
def test_escape_printable_text_is_unchanged(text: str) -> None:
    assert escape(text) == text


@given(ANY_TEXT)
def test_escape_any_text_loses_no_character(text: str) -> None:
    plain = text.replace("\\", "/")  # an unescaped backslash would be ambiguous
    assert escape(plain).encode("ascii", "backslashreplace").decode("unicode_escape") == plain


@given(VALUES, st.integers(10, 200))
def test_short_repr_any_value_is_printable_and_bounded(value: object, max_length: int) -> None:
    text = short_repr(value, max_length)
    assert text.isprintable()
    assert 0 < len(text) <= max_length


@given(st.integers(-(10**30), 10**30) | st.floats(allow_nan=False) | st.booleans() | st.none())
def test_short_repr_short_value_equals_repr(value: object) -> None:
    assert short_repr(value) == repr(value)


@pytest.mark.parametrize("value", [HUGE, -HUGE, [HUGE], {"a": HUGE}, (1, (HUGE,))], ids=short_repr)
def test_short_repr_number_with_too_many_digits_is_described(value: object) -> None:
    assert 0 < len(short_repr(value)) <= 60


@pytest.mark.parametrize(
    "value",
    [
        list(range(10**6)),
        {n: n for n in range(10**6)},
        [[10**6 * [0.0]]],
        "x\x1b" * 10**7,
        np.zeros(10**6),
        [str(n) for n in range(10**6)],
    ],
    ids=["list", "dictionary", "nested", "text", "array", "texts"],
)
def test_short_repr_million_entries_is_fast(value: object) -> None:
    begin = process_time()
    assert len(short_repr(value)) <= 60
    assert process_time() - begin < MAX_SECONDS


@given(ANY_TEXT, ANY_TEXT)
def test_skill_error_any_text_is_one_bounded_printable_line(one: str, other: str) -> None:
    message = str(SkillError(f"{one}: {other}"))
    assert message.isprintable()
    assert len(message) <= MAX_MESSAGE_LENGTH


def test_skill_error_million_lines_is_fast_and_keeps_fix() -> None:
    begin = process_time()
    message = str(InvalidInput("\n".join(["\x1b[2J"] * 10**6) + "; use a shorter text"))
    assert process_time() - begin < MAX_SECONDS
    assert message.endswith("; use a shorter text")
    assert len(message) <= MAX_MESSAGE_LENGTH


@given(ANY_TEXT)
def test_require_printable_text_accepts_bounded_printable_only(text: str) -> None:
    if text.isprintable() and len(text) <= MAX_NAME_LENGTH:
        assert require_printable(text, "the name") == text
        return
    with pytest.raises(InvalidInput, match=r"^the name "):
        require_printable(text, "the name")


@pytest.mark.parametrize("value", [None, 3, b"x", ["x"], HUGE], ids=short_repr)
def test_require_printable_other_type_is_refused(value: object) -> None:
    with pytest.raises(InvalidInput, match="expected text in quotes"):
        require_printable(value, "the name")


def test_short_list_many_names_gives_first_names_and_number() -> None:
    assert short_list(["a", "b", "c"]) == "a, b, c"
    assert short_list([f"n{n}" for n in range(100_000)], 2) == "n0, n1, ... 100000 in all"
    assert len(short_list(["x" * 10**6] * 1000)) < 9 * (MAX_NAME_LENGTH + 2) + 20


@given(st.lists(st.integers(0, 20)))
def test_first_duplicate_integers_equals_quadratic_search(items: list[int]) -> None:
    expected = next((item for n, item in enumerate(items) if item in items[:n]), None)
    assert first_duplicate(items) == expected


def test_first_duplicate_million_items_is_fast() -> None:
    begin = process_time()
    assert first_duplicate(map(str, range(10**6))) is None
    assert process_time() - begin < MAX_SECONDS
