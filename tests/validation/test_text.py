"""Printable text: bounded, printable and quick, whatever is put in."""

from time import process_time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import MAX_MESSAGE_LENGTH, InvalidInput, SkillError
from pilotfish.validation import (
    MAX_NAME_LENGTH,
    escape,
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
QUICK = 2.0  # s of CPU time; building repr of 10^6 entries and every copy of it takes much longer


@given(ANY_TEXT)
def test_escaped_text_is_printable_and_encodes(text: str) -> None:
    escaped = escape(text)
    assert escaped.isprintable()
    escaped.encode("utf-8")


@given(st.text(st.characters(categories=("L", "N", "P", "S"))))
def test_escaping_printable_text_changes_nothing(text: str) -> None:
    assert escape(text) == text


@given(ANY_TEXT)
def test_escaping_loses_no_character(text: str) -> None:
    plain = text.replace("\\", "/")  # a backslash stays as it is, and could be taken for an escape
    assert escape(plain).encode("ascii", "backslashreplace").decode("unicode_escape") == plain


@given(VALUES, st.integers(10, 200))
def test_short_repr_is_printable_and_bounded_for_any_value(value: object, longest: int) -> None:
    text = short_repr(value, longest)
    assert text.isprintable()
    assert 0 < len(text) <= longest


@given(st.integers(-(10**30), 10**30) | st.floats(allow_nan=False) | st.booleans() | st.none())
def test_short_repr_of_a_short_value_is_its_repr(value: object) -> None:
    assert short_repr(value) == repr(value)


@pytest.mark.parametrize("value", [HUGE, -HUGE, [HUGE], {"a": HUGE}, (1, (HUGE,))], ids=short_repr)
def test_short_repr_of_a_number_with_too_many_digits_describes_it(value: object) -> None:
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
def test_short_repr_of_a_million_entries_is_quick(value: object) -> None:
    begin = process_time()
    assert len(short_repr(value)) <= 60
    assert process_time() - begin < QUICK


@given(ANY_TEXT, ANY_TEXT)
def test_message_is_one_printable_line_of_bounded_length(one: str, other: str) -> None:
    message = str(SkillError(f"{one}: {other}"))
    assert message.isprintable()
    assert len(message) <= MAX_MESSAGE_LENGTH


def test_message_with_a_million_lines_is_quick_and_keeps_its_remedy() -> None:
    begin = process_time()
    message = str(InvalidInput("\n".join(["\x1b[2J"] * 10**6) + "; use a shorter text"))
    assert process_time() - begin < QUICK
    assert message.endswith("; use a shorter text")
    assert len(message) <= MAX_MESSAGE_LENGTH


@given(ANY_TEXT)
def test_require_printable_accepts_printable_text_of_bounded_length_alone(text: str) -> None:
    if text.isprintable() and len(text) <= MAX_NAME_LENGTH:
        assert require_printable(text, "the name") == text
        return
    with pytest.raises(InvalidInput, match=r"^the name "):
        require_printable(text, "the name")


@pytest.mark.parametrize("value", [None, 3, b"x", ["x"], HUGE], ids=short_repr)
def test_require_printable_refuses_other_kinds(value: object) -> None:
    with pytest.raises(InvalidInput, match="expected text in quotes"):
        require_printable(value, "the name")


def test_short_list_of_many_names_gives_the_first_and_their_number() -> None:
    assert short_list(["a", "b", "c"]) == "a, b, c"
    assert short_list([f"n{n}" for n in range(100_000)], 2) == "n0, n1, ... 100000 in all"
    assert len(short_list(["x" * 10**6] * 1000)) < 9 * (MAX_NAME_LENGTH + 2) + 20


@given(st.lists(st.integers(0, 20)))
def test_first_repeated_is_the_first_item_met_before(items: list[int]) -> None:
    expected = next((item for n, item in enumerate(items) if item in items[:n]), None)
    assert first_duplicate(items) == expected


def test_first_repeated_of_a_million_items_is_quick() -> None:
    begin = process_time()
    assert first_duplicate(map(str, range(10**6))) is None
    assert process_time() - begin < QUICK
