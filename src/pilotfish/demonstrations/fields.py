"""What a manifest may say under a key; every refusal names the place and the nearest fix."""

import difflib
from collections.abc import Sequence
from math import isfinite
from typing import Any

from pilotfish.errors import InvalidInput


def fields(value: object, place: str, needed: Sequence[str], allowed: Sequence[str]) -> dict[str, Any]:
    """A table that has every needed key and no other than those and the allowed."""
    if not isinstance(value, dict):
        raise InvalidInput(f"{place} is {_shown(value)}, expected a table with {', '.join(needed)}")
    known = [*needed, *allowed]
    for key in value:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
            raise InvalidInput(f"{place}: unknown key {key!r}; {hint}")
    if missing := [key for key in needed if key not in value]:
        raise InvalidInput(f"{place}: key {missing[0]!r} is missing")
    return value


def items(value: object, place: str) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidInput(f"{place} is {_shown(value)}, expected a list")
    return value


def text(value: object, place: str) -> str:
    if not isinstance(value, str):
        raise InvalidInput(f"{place} is {_shown(value)}, expected text in quotes")
    return value


def whole(value: object, place: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise InvalidInput(f"{place} is {_shown(value)}, expected a whole number")
    return value


def number(value: object, place: str) -> float:
    """A finite number; one too large for float64 is refused too."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            if isfinite(float(value)):
                return float(value)
        except OverflowError:
            pass
    raise InvalidInput(f"{place} is {_shown(value)}, expected a finite number")


def _shown(value: object) -> str:
    try:
        whole_text = repr(value)
    except ValueError:  # an integer with more digits than Python prints
        whole_text = "a number that is too long"
    return whole_text if len(whole_text) <= 60 else f"{whole_text[:57]}..."
