"""One-line representation of values that hold arrays: type, shapes and the few scalars that matter."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import TypeVar

import numpy as np

from pilotfish.validation.text import short_repr

C = TypeVar("C", bound=type)

MAX_LENGTH = 200  # characters of a representation
MAX_FIELD = 60  # characters of one field
MAX_ENTRIES = 7  # of an array that is printed in full: a pose
DIGITS = 6  # significant, of floats


def shorten_repr(cls: C) -> C:
    """Give a dataclass or named tuple a repr of one line and at most 200 characters.

    Arrays are described by their shape, or printed if they have at most seven entries. Nested values are
    described by their name or type. Fields that do not fit are left out, which `...` marks.

    Args:
        cls: Class to change.

    Returns:
        The same class.
    """
    type.__setattr__(cls, "__repr__", _fields_repr)  # an assignment that the type checker accepts
    return cls


def _fields_repr(value: object) -> str:
    kind = type(value)
    if is_dataclass(value):
        names = [field.name for field in fields(value) if field.repr]
    else:
        names = list(getattr(kind, "_fields", ()))
    text = f"{kind.__qualname__}("
    for n, name in enumerate(names):
        entry = f"{', ' if n else ''}{name}={_describe(getattr(value, name, '?'))}"
        if len(text) + len(entry) > MAX_LENGTH - len(", ...)"):
            return f"{text}{', ' if n else ''}...)"
        text += entry
    return f"{text})"


def _describe(value: object) -> str:
    """Return a short text for the value of a field."""
    if isinstance(value, np.ndarray):
        return _describe_array(value)
    if isinstance(value, float | np.floating):
        return f"{float(value):.{DIGITS}g}"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return f"{{{len(value)} entries}}" if value else "{}"
    if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
        return _describe_sequence(value)
    if value is None or isinstance(value, str | int | np.integer):
        return short_repr(value, MAX_FIELD)
    if isinstance(value, type) or callable(value):
        return str(getattr(value, "__qualname__", type(value).__name__))
    return _describe_object(value)


def _describe_array(array: np.ndarray) -> str:
    is_short = array.ndim == 1 and array.size <= MAX_ENTRIES and array.dtype.kind in "biuf"
    if is_short and not np.ma.is_masked(array):  # a masked entry is None
        return f"[{', '.join(f'{entry:.4g}' for entry in array.tolist())}]"
    return f"array({' x '.join(map(str, array.shape))})"


def _describe_sequence(values: tuple[object, ...] | list[object]) -> str:
    if all(isinstance(value, str | int | float) for value in values):
        text = f"[{', '.join(_describe(value) for value in values)}]"
        return text if len(text) <= MAX_FIELD else f"[{len(values)} entries]"
    names = [getattr(value, "name", None) for value in values]
    if all(isinstance(name, str) and name for name in names):
        text = f"[{', '.join(map(str, names))}]"
        return text if len(text) <= MAX_FIELD else f"[{len(values)} entries]"
    return f"[{len(values)} x {' | '.join(sorted({type(value).__name__ for value in values}))}]"


def _describe_object(value: object) -> str:
    """Return the repr of a small value without arrays; the type's name of any other."""
    name = type(value).__name__
    if not is_dataclass(value):
        return name
    contents = [getattr(value, field.name, None) for field in fields(value)]
    plain = all(content is None or isinstance(content, str | int | float | Enum) for content in contents)
    text = _fields_repr(value)
    if plain and len(text) <= MAX_FIELD:
        return text
    return f"{name}(...)"
