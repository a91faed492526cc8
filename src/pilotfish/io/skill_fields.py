"""Dataclasses taken apart into what JSON holds and what arrays hold, and put together again."""

import math
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, TypeVar, get_type_hints

import numpy as np

from pilotfish.demonstrations import Layout, Part
from pilotfish.errors import InvalidInput
from pilotfish.models.durations import DISTRIBUTIONS, DurationDistribution
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_printable, short_list, short_repr

Arrays = dict[str, Array]
T = TypeVar("T")

JSON_TYPES = (bool, int, float, str)
MAX_TEXT_LENGTH = 10_000  # characters of a note
MAX_TEXTS = 100_000  # names of demonstrations
MAX_COUNT = 2**53  # up to here float64 counts one by one

# Field types that have several classes, by the name of each in a file; the first has no name in a file.
TAGGED_UNIONS: dict[Any, dict[str, type[Any]]] = {DurationDistribution: {**DISTRIBUTIONS}}


def encode_dataclass(value: Any, place: str, sizes: Mapping[str, int]) -> tuple[dict[str, Any], Arrays]:
    """The plain fields of a dataclass by name, and its arrays by dotted name, nested dataclasses included.

    Arrays have the shape that their annotation gives them; sizes says how long its letters are, others may
    have any one length. An inner dataclass that equals the default of its field is left out.
    Raises: InvalidInput, when a field does not hold what is declared.
    """
    plain: dict[str, Any] = {}
    arrays: Arrays = {}
    sizes = dict(sizes)
    for name, kind in _field_types(type(value)).items():
        here, content = f"{place}.{name}", getattr(value, name)
        if is_dataclass(kind) and content == _default_dataclass(type(value), name):
            continue
        if is_dataclass(kind) or kind in TAGGED_UNIONS:
            inner, more = encode_dataclass(content, here, sizes)
            if kind in TAGGED_UNIONS:
                inner |= _type_tag(content, TAGGED_UNIONS[kind])
            plain |= {f"{name}.{key}": item for key, item in inner.items()}
            arrays |= more
        elif _is_json_type(kind):
            plain[name] = _encode_json_value(content, kind, here)
        else:
            arrays[here] = np.ascontiguousarray(content, dtype=np.float64)
            validate_array(arrays[here], kind, here, sizes)
    return plain, arrays


def decode_dataclass(kind: type[T], place: str, plain: Any, arrays: Arrays, sizes: Mapping[str, int]) -> T:
    """The value that take_apart took apart; what was used of plain and arrays is removed from them.

    Raises: InvalidInput, when anything is missing or not what is declared.
    """
    values: dict[str, Any] = {}
    sizes = dict(sizes)
    for name, declared in _field_types(kind).items():
        here = f"{place}.{name}"
        if is_dataclass(declared) or declared in TAGGED_UNIONS:
            inner = {key: plain.pop(key) for key in list(plain) if key.startswith(f"{name}.")}
            inner = {key.removeprefix(f"{name}."): item for key, item in inner.items()}
            default = _default_dataclass(kind, name)
            if not inner and default is not None:
                values[name] = default
                continue
            chosen = (
                _tagged_type(inner, TAGGED_UNIONS[declared], here)
                if declared in TAGGED_UNIONS
                else _as_class(declared)
            )
            values[name] = decode_dataclass(chosen, here, inner, arrays, sizes)
            if default is not None and values[name] == default:
                raise InvalidInput(f"{here} is written out, expected it left out: it is {default}")
        elif _is_json_type(declared):
            values[name] = decode_json_value(pop_field(plain, name, place), declared, here)
        else:
            values[name] = pop_field(arrays, here, "the file")
            validate_array(values[name], declared, here, sizes)
    reject_unknown_fields(plain, place)
    return kind(**values)


def pop_field(things: Any, name: str, place: str) -> Any:
    """The thing of that name, removed from things.    Raises: InvalidInput, when there is none."""
    if not isinstance(things, dict) or name not in things:
        has = short_list(sorted(things)) if isinstance(things, dict) else short_repr(things)
        raise InvalidInput(f"{place} lacks {name!r}, it has {has}")
    return things.pop(name)


def pop_list(header: dict[str, Any], name: str) -> list[Any]:
    """The list of that name, removed from the header.    Raises: InvalidInput, when there is none."""
    value = pop_field(header, name, "the header")
    if not isinstance(value, list):
        raise InvalidInput(f"{name} is {short_repr(value)}, expected a list")
    return value


def encode_layout(layout: Layout) -> list[dict[str, Any]]:
    """The parts of a row as JSON holds them."""
    return [encode_dataclass(part, "layout", {})[0] for part in layout.parts]


def decode_layout(parts: list[Any]) -> Layout:
    """The layout that layout_apart took apart.    Raises: InvalidInput, when it cannot be one."""
    return Layout(tuple(decode_dataclass(Part, "layout", part, {}, {}) for part in parts))


def reject_unknown_fields(things: Mapping[str, Any], place: str) -> None:
    if things:
        raise InvalidInput(f"{place} has {short_list(sorted(things))}, expected nothing more")


def validate_array(array: Array, kind: Any, place: str, sizes: dict[str, int]) -> None:
    """The array is finite and has the annotated shape, as in Float[Array, "K D"]; sizes gains new letters."""
    letters = kind.dim_str.split()
    shape = tuple(sizes.setdefault(letter, size) for letter, size in zip(letters, array.shape, strict=False))
    if array.shape != shape or len(letters) != array.ndim or array.size == 0:
        known = ", ".join(f"{letter} = {size}" for letter, size in sizes.items())
        raise InvalidInput(f"{place} has shape {array.shape}, expected {shape}: {kind.dim_str} of {known}")
    validate_finite(array, place)


def validate_finite(array: Float[Array, "..."], place: str) -> None:
    if (bad := np.argwhere(~np.isfinite(array))).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{place}{index} is {array[tuple(index)]}, expected finite numbers everywhere")


def decode_json_value(value: Any, kind: Any, place: str) -> Any:
    """A plain value of the declared kind.    Raises: InvalidInput, when JSON holds another."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        known = [member.value for member in kind]
        if value not in known:
            raise InvalidInput(
                f"{place} is {short_repr(value)}, which this version does not know, only {known}"
            )
        return kind(value)
    if kind == tuple[str, ...]:
        if not isinstance(value, list) or len(value) > MAX_TEXTS:
            raise InvalidInput(
                f"{place} is {short_repr(value)}, expected a list of at most {MAX_TEXTS} texts"
            )
        return tuple(require_printable(item, f"{place} {n}") for n, item in enumerate(value))
    if kind is float and value is None:
        return math.nan
    if type(value) is not kind:
        raise InvalidInput(f"{place} is {short_repr(value)}, expected {kind.__name__}")
    if kind is int:
        return require_count(value, place, MAX_COUNT)
    if kind is str:
        return require_printable(value, place, MAX_TEXT_LENGTH)
    return require_number(value, place, -sys.float_info.max, sys.float_info.max) if kind is float else value


def _encode_json_value(value: Any, kind: Any, place: str) -> Any:
    if isinstance(value, Enum):
        return value.value
    plain: Any = [str(item) for item in value] if kind == tuple[str, ...] else kind(value)
    if kind is float and math.isnan(plain):
        return None
    decode_json_value(plain, kind, place)  # what could not be read is not written
    return plain


def _field_types(kind: type) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _is_json_type(kind: Any) -> bool:
    return (
        kind in JSON_TYPES or kind == tuple[str, ...] or (isinstance(kind, type) and issubclass(kind, Enum))
    )


def _default_dataclass(kind: type, name: str) -> Any:
    """The default of a field that is a dataclass itself; None, where there is none."""
    (value,) = (field.default for field in fields(kind) if field.name == name)
    return value if is_dataclass(value) else None


def _type_tag(value: Any, kinds: Mapping[str, type[Any]]) -> dict[str, str]:
    for n, (name, kind) in enumerate(kinds.items()):
        if type(value) is kind:
            return {"kind": name} if n else {}
    raise InvalidInput(f"{type(value).__name__} cannot be written to a skill file, only {', '.join(kinds)}")


def _tagged_type(inner: dict[str, Any], kinds: Mapping[str, type[Any]], place: str) -> type[Any]:
    first, *others = kinds
    if "kind" not in inner:
        return kinds[first]
    if isinstance(name := inner.pop("kind"), str) and name in others:
        return kinds[name]
    raise InvalidInput(
        f"{place} are of the kind {short_repr(name)}, which this version does not know, only {others}"
    )


def _as_class(kind: Any) -> type[Any]:
    assert isinstance(kind, type)
    return kind
