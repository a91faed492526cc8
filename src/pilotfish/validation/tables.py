"""Checks of tables of TOML and JSON files that a person writes."""

from collections.abc import Sequence
from typing import Any

from pilotfish.errors import InvalidInput
from pilotfish.validation.text import nearest_name, short_repr


def require_table(
    value: object, label: str, needed: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, Any]:
    """Return a table that has every needed key, and no key that is neither needed nor optional.

    Args:
        value: Value to check.
        label: Place in the file; messages begin with it.
        needed: Keys that must be present.
        optional: Keys that may be present.

    Raises:
        InvalidInput: If it is another type, or a key is unknown or missing.
    """
    if not isinstance(value, dict):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a table with {', '.join(needed)}")
    known = [*needed, *optional]
    for key in value:
        if key not in known:
            nearest = nearest_name(key, known)
            hint = f"did you mean {nearest!r}?" if nearest else f"known are {', '.join(known)}"
            raise InvalidInput(f"{label}: unknown key {short_repr(key)}; {hint}")
    if missing := [key for key in needed if key not in value]:
        raise InvalidInput(f"{label}: key {missing[0]!r} is missing")
    return value
