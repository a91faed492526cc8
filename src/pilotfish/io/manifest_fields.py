"""The tables and lists of a manifest: known keys alone; every refusal names the place and the nearest fix."""

from collections.abc import Sequence
from typing import Any

from pilotfish.errors import InvalidInput
from pilotfish.validation import nearest_name, short_repr


def require_table(value: object, label: str, needed: Sequence[str], allowed: Sequence[str]) -> dict[str, Any]:
    """A table that has every needed key and no other than those and the allowed."""
    if not isinstance(value, dict):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a table with {', '.join(needed)}")
    known = [*needed, *allowed]
    for key in value:
        if key not in known:
            near = nearest_name(key, known)
            hint = f"did you mean {near!r}?" if near else f"known are {', '.join(known)}"
            raise InvalidInput(f"{label}: unknown key {short_repr(key)}; {hint}")
    if missing := [key for key in needed if key not in value]:
        raise InvalidInput(f"{label}: key {missing[0]!r} is missing")
    return value


def require_list(value: object, label: str) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a list")
    return value
