"""Codec from dataclasses to JSON values and arrays, for skill and stream files.

A dataclass becomes a JSON object of its numbers, texts, enums and nested dataclasses; its arrays go to a
separate mapping under dotted names, such as `dynamics.durations.rates`. Where several classes are possible,
the object has the key `kind` with the registered name of the class (`Variants`). Fields and array shapes come
from the annotations of the dataclass, so a new covariance structure or duration distribution needs no code
here.

Decoding removes every field that it reads from the header and from the arrays: what remains at the end is
unknown and is refused. Counts, texts and lists are bounded, and only registered classes are built.
"""

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
Variants = Mapping[str, type[Any]]  # classes by their name in a file
T = TypeVar("T")

MAX_TEXT_LENGTH = 10_000  # characters of a note
MAX_TEXTS = 100_000  # names of demonstrations
MAX_COUNT = 2**53  # integers up to this are exact in float64
VARIANTS: dict[Any, Variants] = {DurationDistribution: DISTRIBUTIONS}  # by the declared type of a field


def encode_dataclass(value: Any, place: str, sizes: Mapping[str, int]) -> tuple[dict[str, Any], Arrays]:
    """Return the fields of a dataclass as JSON values, and its arrays by dotted name.

    Args:
        value: Dataclass to encode.
        place: Dotted name of the value, for messages and names of arrays.
        sizes: Length of the axes named in annotations; an axis not in it may have any length.

    Raises:
        InvalidInput: If a field does not match its annotation.
    """
    header: dict[str, Any] = {}
    arrays: Arrays = {}
    sizes = dict(sizes)
    for name, declared in _field_types(type(value)).items():
        field_place, content = f"{place}.{name}", getattr(value, name)
        if declared in VARIANTS or is_dataclass(declared):
            if declared in VARIANTS:
                header[name], inner = encode_variant(content, VARIANTS[declared], field_place, sizes)
            else:
                header[name], inner = encode_dataclass(content, field_place, sizes)
            arrays |= inner
        elif _is_json_type(declared):
            header[name] = _encode_json_value(content, declared, field_place)
        else:
            arrays[field_place] = np.ascontiguousarray(content, dtype=np.float64)
            validate_array(arrays[field_place], declared, field_place, sizes)
    return header, arrays


def decode_dataclass(kind: type[T], place: str, header: Any, arrays: Arrays, sizes: Mapping[str, int]) -> T:
    """Return the dataclass that `encode_dataclass` encoded; remove its fields from header and arrays.

    Args:
        kind: Class to build.
        place: Dotted name of the value, as for `encode_dataclass`.
        header: JSON object of the fields.
        arrays: Arrays by dotted name.
        sizes: Length of the axes named in annotations.

    Raises:
        InvalidInput: If a field is missing, unknown, or does not match its annotation.
    """
    values: dict[str, Any] = {}
    sizes = dict(sizes)
    for name, declared in _field_types(kind).items():
        field_place = f"{place}.{name}"
        if declared in VARIANTS:
            field = pop_field(header, name, place)
            values[name] = decode_variant(VARIANTS[declared], field_place, field, arrays, sizes)
        elif is_dataclass(declared):
            assert isinstance(declared, type)
            field = pop_field(header, name, place)
            values[name] = decode_dataclass(declared, field_place, field, arrays, sizes)
        elif _is_json_type(declared):
            values[name] = decode_json_value(pop_field(header, name, place), declared, field_place)
        else:
            values[name] = pop_field(arrays, field_place, "the file")
            validate_array(values[name], declared, field_place, sizes)
    reject_unknown_fields(header, place)
    return kind(**values)


def encode_variant(
    value: Any, variants: Variants, place: str, sizes: Mapping[str, int]
) -> tuple[dict[str, Any], Arrays]:
    """Return the fields of a dataclass of a registered class, with the key `kind`, and its arrays.

    Raises:
        InvalidInput: If the class is not registered, or as `encode_dataclass`.
    """
    for name, variant in variants.items():
        if type(value) is variant:
            header, arrays = encode_dataclass(value, place, sizes)
            return {"kind": name, **header}, arrays
    raise InvalidInput(
        f"{place} is a {type(value).__name__}, which cannot be written to a file, expected one of "
        f"{', '.join(variant.__name__ for variant in variants.values())}"
    )


def decode_variant(
    variants: Variants, place: str, header: Any, arrays: Arrays, sizes: Mapping[str, int]
) -> Any:
    """Return the dataclass that `encode_variant` encoded.

    Raises:
        InvalidInput: If `kind` is not a registered name, or as `decode_dataclass`.
    """
    name = pop_field(header, "kind", place)
    if not isinstance(name, str) or name not in variants:
        raise InvalidInput(
            f"{place}.kind is {short_repr(name)}, expected one of {', '.join(variants)}; "
            "a newer version of pilotfish may know it"
        )
    return decode_dataclass(variants[name], place, header, arrays, sizes)


def pop_field(table: Any, name: str, place: str) -> Any:
    """Return a field and remove it from its table.

    Raises:
        InvalidInput: If the table does not have it, or is not a table.
    """
    if not isinstance(table, dict) or name not in table:
        found = short_list(sorted(table)) if isinstance(table, dict) else short_repr(table)
        raise InvalidInput(f"{place} lacks {name!r}, it has {found}")
    return table.pop(name)


def pop_list(header: dict[str, Any], name: str) -> list[Any]:
    """Return a list of the header and remove it.

    Raises:
        InvalidInput: If the header does not have it, or it is not a list.
    """
    value = pop_field(header, name, "the header")
    if not isinstance(value, list):
        raise InvalidInput(f"{name} is {short_repr(value)}, expected a list")
    return value


def reject_unknown_fields(table: Any, place: str) -> None:
    """Raise InvalidInput if a table still has fields, or is not a table."""
    if not isinstance(table, Mapping):
        raise InvalidInput(f"{place} is {short_repr(table)}, expected a table")
    if table:
        raise InvalidInput(f"{place} has the unknown fields {short_list(sorted(table))}, expected no others")


def encode_layout(layout: Layout) -> list[dict[str, Any]]:
    """Return the parts of a layout as JSON objects."""
    return [encode_dataclass(part, "layout", {})[0] for part in layout.parts]


def decode_layout(parts: list[Any]) -> Layout:
    """Return the layout that `encode_layout` encoded.

    Raises:
        InvalidInput: If a part is not valid.
    """
    return Layout(tuple(decode_dataclass(Part, "layout", part, {}, {}) for part in parts))


def validate_array(array: Float[Array, "..."], annotation: Any, place: str, sizes: dict[str, int]) -> None:
    """Check that an array is finite and has the annotated shape, as in Float[Array, "K D"].

    Args:
        array: Array to check.
        annotation: Annotation with the names of the axes.
        place: Name of the array, for the message.
        sizes: Length of the named axes; axes that are new are added.

    Raises:
        InvalidInput: If the shape differs, the array is empty, or a value is not finite.
    """
    axes = annotation.dim_str.split()
    sizes.update((axis, int(axis)) for axis in axes if axis.isdigit())  # an axis of fixed length
    shape = tuple(sizes.setdefault(axis, size) for axis, size in zip(axes, array.shape, strict=False))
    if array.shape != shape or len(axes) != array.ndim or array.size == 0:
        known = ", ".join(f"{axis} = {size}" for axis, size in sizes.items())
        raise InvalidInput(
            f"{place} has shape {array.shape}, expected {shape}: {annotation.dim_str} with {known}"
        )
    validate_finite(array, place)


def validate_finite(array: Float[Array, "..."], place: str) -> None:
    """Raise InvalidInput if a value of an array is not finite; the message names the first."""
    if (bad := np.argwhere(~np.isfinite(array))).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{place}{index} is {array[tuple(index)]}, expected finite numbers")


def decode_json_value(value: Any, kind: Any, place: str) -> Any:
    """Return a number, text, flag, enum or tuple of texts of the declared type; null is NaN.

    Args:
        value: JSON value.
        kind: Declared type.
        place: Dotted name of the value, for the message.

    Raises:
        InvalidInput: If the value has another type or is out of bounds.
    """
    if isinstance(kind, type) and issubclass(kind, Enum):
        known = [member.value for member in kind]
        if value not in known:
            raise InvalidInput(
                f"{place} is {short_repr(value)}, expected one of {', '.join(map(str, known))}"
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
    encoded: Any = [str(item) for item in value] if kind == tuple[str, ...] else kind(value)
    if kind is float and math.isnan(encoded):
        return None
    decode_json_value(encoded, kind, place)  # what could not be read is not written
    return encoded


def _field_types(kind: type) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _is_json_type(kind: Any) -> bool:
    is_enum = isinstance(kind, type) and issubclass(kind, Enum)
    return is_enum or kind in (bool, int, float, str) or kind == tuple[str, ...]
