"""Printable text: strings from a file or a user, made safe to print and to quote in a message.

A terminal obeys control characters and cannot encode lone surrogates. Text from outside is therefore refused
where it is read (`require_printable`) or escaped where it is quoted (`errors.escape`, `short_repr`).
"""

import difflib
import reprlib
from collections.abc import Collection, Hashable, Iterable
from itertools import islice
from typing import TypeVar

from pilotfish.errors import InvalidInput, escape

T = TypeVar("T", bound=Hashable)

MAX_NAME_LENGTH = 200  # characters
MAX_COMPARED_NAMES = 200  # one comparison takes up to a millisecond

_repr = reprlib.Repr()
_repr.maxstring = _repr.maxother = _repr.maxlong = 60


def require_printable(text: object, label: str, max_length: int = MAX_NAME_LENGTH) -> str:
    """Return text unchanged if it is a printable string on one line.

    Args:
        text: Value to check.
        label: Name of the value; the message begins with it.
        max_length: Largest number of characters.

    Raises:
        InvalidInput: If it is not a string, is longer, or contains a control character, a line break or a
            lone surrogate.
    """
    if not isinstance(text, str):
        raise InvalidInput(f"{label} is {short_repr(text)}, expected text in quotes")
    if len(text) > max_length:
        raise InvalidInput(f"{label} has {len(text)} characters, expected at most {max_length}; shorten it")
    if not text.isprintable():
        raise InvalidInput(
            f"{label} is {short_repr(text)}, expected printable characters on one line; remove the others"
        )
    return text


def require_name(name: object, label: str) -> str:
    """Return a name unchanged if it is printable, not empty, and has no blanks at its ends.

    Args:
        name: Value to check.
        label: Meaning of the name; the message begins with it.

    Raises:
        InvalidInput: If it is not.
    """
    if not (text := require_printable(name, label)) or text != text.strip():
        raise InvalidInput(f"{label} is {text!r}, expected text on one line without blanks at its ends")
    return text


def short_repr(value: object, max_length: int = 60) -> str:
    """Return repr(value) in a bounded number of printable characters, for any value.

    Long strings are cut in the middle, containers after a few items, before their whole text is built. An
    integer with more digits than Python prints is described by its size.

    Args:
        value: Any value.
        max_length: Largest number of characters, at least 4.
    """
    if isinstance(value, int) and value.bit_length() > 200:
        return f"a whole number of {value.bit_length()} bits"
    try:
        text = _repr.repr(value)
    except ValueError:  # an integer inside a container with more digits than Python prints
        text = f"a {type(value).__name__} with a number that is too long"
    text = escape(text)
    return text if len(text) <= max_length else f"{text[: max_length - 3]}..."


def short_list(items: Collection[object], max_items: int = 8) -> str:
    """Return items separated by commas; a longer collection is cut and its size added.

    Args:
        items: Strings are listed without quotes, other values as `short_repr` writes them.
        max_items: Number of items that are listed.
    """
    texts = [item if isinstance(item, str) else short_repr(item) for item in islice(items, max_items)]
    text = ", ".join(escape(item[:MAX_NAME_LENGTH]) for item in texts)
    return text if len(items) <= max_items else f"{text}, ... {len(items)} in all"


def first_duplicate(items: Iterable[T]) -> T | None:
    """Return the first item that equals an earlier one, or None, in linear time.

    Args:
        items: Hashable items.
    """
    previous: set[T] = set()
    for item in items:
        if item in previous:
            return item
        previous.add(item)
    return None


def nearest_name(name: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Return the known name that is most similar to a mistyped one, or None if none is similar enough.

    Args:
        name: Mistyped name.
        known: Existing names; only the first MAX_COMPARED_NAMES are compared.
        cutoff: Smallest similarity that counts, from 0 to 1.
    """
    near = difflib.get_close_matches(
        name[:MAX_NAME_LENGTH], list(islice(known, MAX_COMPARED_NAMES)), 1, cutoff
    )
    return near[0] if near else None
