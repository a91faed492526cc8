"""Manifest of a folder of demonstrations: demonstrations.toml or demonstrations.json (docs/folder-format.md).

A manifest may be written by hand, so every message names the place in the file, the value and what was
expected, and an unknown key is answered with the nearest known one. Limits are checked before anything of
that size is built.
"""

import hashlib
import json
import tomllib
from pathlib import PurePath
from typing import Any

from pilotfish.demonstrations import (
    Frame,
    Layout,
    Part,
    Quantity,
)
from pilotfish.errors import InvalidInput
from pilotfish.io.frame_tables import FORMS, parse_frame
from pilotfish.validation import (
    first_duplicate,
    require_count,
    require_name,
    require_period,
    require_printable,
    require_table,
    short_repr,
)

FORMAT, VERSION = "pilotfish demonstrations", 1
MANIFEST_NAMES = ("demonstrations.toml", "demonstrations.json")
TABLE_SUFFIXES = (".csv", ".npz")
MAX_MANIFEST_BYTES = 2**24
MAX_DEMONSTRATIONS = 10_000
MAX_FRAME_ENTRIES = 2**26  # numbers in the matrices of all frames
SHA256_LENGTH = 64  # digits
MAX_INTEGER = 2**53  # integers up to this are exact in every JSON reader
# Frames by name. A moving frame has the names of two arrays of the NPZ file: of its matrices and its offsets.
Frames = dict[str, Frame | tuple[str, str]]
# Time between rows [s], columns, and by name of the CSV or NPZ file: the name of the demonstration, which may
# be empty, the checksum of the file, empty if there is none, and the frames, empty for the world frame only.
Manifest = tuple[float, Layout, dict[str, tuple[str, str, Frames]]]


def parse_manifest(data: bytes, name: str) -> Manifest:
    """Parse and validate a manifest.

    Args:
        data: Content of the file.
        name: Name of the file; the suffix .toml means TOML, any other JSON.

    Returns:
        The period, the layout and the entries.

    Raises:
        InvalidInput: If the manifest cannot be used; the message names the key, its value and the nearest
            fix.
    """
    content = _parse_text(data, name)
    _require_format(content, name)
    keys = ("format", "version", "period", "layout", "demonstration")
    table = require_table(content, name, keys, ("sha256",))
    _require_checksum(table, name)
    layout = _parse_layout(table["layout"], f"{name}: layout")
    items = _require_list(table["demonstration"], f"{name}: demonstration")
    _require_size(items, layout, name)
    _require_different_files(items, name)
    entries = [_parse_entry(item, f"{name}: demonstration {m}", layout) for m, item in enumerate(items)]
    if not entries:
        raise InvalidInput(f"{name}: demonstration is empty, expected at least one; add [[demonstration]]")
    return require_period(table["period"], f"{name}: period"), layout, dict(entries)


def serialise_manifest(content: dict[str, Any]) -> bytes:
    """Return the bytes of demonstrations.json, with format, version and a checksum of the content.

    Args:
        content: The keys period, layout and demonstration, as JSON values.

    Raises:
        InvalidInput: If the manifest would be too large to be read again.
    """
    table = {"format": FORMAT, "version": VERSION, **content}
    signed = {**table, "sha256": manifest_hash(table)}
    lines = [f"  {json.dumps(key)}: {_format_value(value)}" for key, value in signed.items()]
    data = ("{\n" + ",\n".join(lines) + "\n}\n").encode()
    if len(data) > MAX_MANIFEST_BYTES:
        raise InvalidInput(
            f"the manifest would have {len(data)} bytes, expected at most {MAX_MANIFEST_BYTES}; write the "
            "demonstrations to several folders"
        )
    return data


def layout_to_dicts(layout: Layout) -> list[dict[str, Any]]:
    """Return the parts of a layout as JSON values."""
    return [
        {
            "name": part.name,
            "quantity": part.quantity.value,
            "size": part.size,
            "unit": part.unit,
            "derivative": part.derivative,
        }
        for part in layout.parts
    ]


def manifest_hash(content: dict[str, Any]) -> str:
    """Return the SHA-256 of a manifest's content, however it is indented, without the key sha256."""
    table = {key: value for key, value in content.items() if key != "sha256"}
    canonical = json.dumps(table, sort_keys=True, separators=(",", ":"), default=repr)
    return hashlib.sha256(canonical.encode()).hexdigest()


def _format_value(value: object) -> str:
    if not isinstance(value, list):
        return json.dumps(value)
    return "[\n    " + ",\n    ".join(map(json.dumps, value)) + "\n  ]"


def _parse_text(data: bytes, name: str) -> object:
    kind = "TOML" if name.endswith(".toml") else "JSON"
    try:
        text = data.decode("utf-8-sig")
        if kind == "TOML":
            return tomllib.loads(text)
        return json.loads(text, object_pairs_hook=_require_unique_keys)
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from error
    except UnicodeDecodeError as error:
        raise InvalidInput(
            f"{name}: byte {error.start} is not UTF-8 text, expected UTF-8; save the file as UTF-8"
        ) from error
    except (ValueError, RecursionError) as error:  # syntax errors of both, and numbers with too many digits
        raise InvalidInput(f"{name}: not {kind} that can be read: {error}; correct that line") from error


def _require_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        duplicate = first_duplicate(key for key, _ in pairs)
        raise InvalidInput(f"key {short_repr(duplicate)} is given more than once in one table; keep one")
    return table


def _require_format(content: object, name: str) -> None:
    table = content if isinstance(content, dict) else {}
    if table.get("format") != FORMAT:
        found = short_repr(table.get("format"))
        raise InvalidInput(f'{name}: format is {found}, expected format = "{FORMAT}"')
    version = require_count(table.get("version"), f"{name}: version", 2**31, -(2**31))
    if version > VERSION:
        raise InvalidInput(
            f"{name}: written by a newer version (format {version}, this one reads {VERSION}); "
            "upgrade pilotfish"
        )
    if version != VERSION:
        raise InvalidInput(f"{name}: version is {version}, expected {VERSION}")


def _require_checksum(table: dict[str, Any], name: str) -> None:
    if "sha256" not in table:
        return
    try:
        actual = manifest_hash(table)
    except (ValueError, RecursionError) as error:  # numbers with more digits than Python prints
        raise InvalidInput(f"{name}: its sha256 cannot be checked: {error}") from error
    if table["sha256"] != actual:
        raise InvalidInput(
            f"{name}: changed after it was written: its sha256 is {actual}, expected "
            f"{short_repr(table['sha256'], 70)}; if the change is meant, delete the key sha256 at the top"
        )


def _require_size(items: list[Any], layout: Layout, name: str) -> None:
    """Raise InvalidInput before frames are built that would not fit in memory."""
    require_count(len(items), f"{name}: the number of demonstrations", MAX_DEMONSTRATIONS)
    lists = [item.get("frames") if isinstance(item, dict) else None for item in items]
    frames = sum(len(given) if isinstance(given, list) and given else 1 for given in lists)
    if (entries := frames * layout.width**2) > MAX_FRAME_ENTRIES:
        raise InvalidInput(
            f"{name}: the matrices of {frames} frames of {layout.width} columns have {entries} numbers, "
            f"expected at most {MAX_FRAME_ENTRIES}; use several folders"
        )


def _require_different_files(items: list[Any], name: str) -> None:
    """Raise InvalidInput before frames are built of a demonstration that is repeated many times."""
    files = [item["file"] for item in items if isinstance(item, dict) and isinstance(item.get("file"), str)]
    if duplicate := first_duplicate(files):
        raise InvalidInput(
            f"{name}: file {short_repr(duplicate)} is named more than once, expected one file for each"
        )


def _parse_layout(value: object, label: str) -> Layout:
    parts = [_parse_part(item, f"{label} {n}") for n, item in enumerate(_require_list(value, label))]
    try:
        return Layout(tuple(parts))
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _parse_part(value: object, label: str) -> Part:
    table = require_table(value, label, ("name", "quantity", "size", "unit"), ("derivative",))
    known = [quantity.value for quantity in Quantity]
    if table["quantity"] not in known:
        found = short_repr(table["quantity"])
        raise InvalidInput(f"{label}: quantity is {found}, expected one of {', '.join(known)}")
    size, derivative = (
        require_count(table.get(key, 0), f"{label}: {key}", MAX_INTEGER, -MAX_INTEGER)
        for key in ("size", "derivative")
    )
    name, unit = (require_printable(table[key], f"{label}: {key}") for key in ("name", "unit"))
    try:
        return Part(name, Quantity(table["quantity"]), size, unit, derivative)
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _parse_entry(value: object, label: str, layout: Layout) -> tuple[str, tuple[str, str, Frames]]:
    table = require_table(value, label, ("file",), ("name", "sha256", "frames"))
    file = require_printable(table["file"], f"{label}: file")
    path = PurePath(file)
    if path.name != file or "\\" in file or path.suffix not in TABLE_SUFFIXES:
        raise InvalidInput(
            f"{label}: file is {file!r}, expected the name of a .csv or .npz file in this folder"
        )
    items = _require_list(table.get("frames", []), f"{label}: frames")
    frames = [_parse_frame(item, f"{label}, frame {n}", layout) for n, item in enumerate(items)]
    if duplicate := first_duplicate(name for name, _ in frames):
        raise InvalidInput(f"{label}: two frames are named {duplicate!r}, expected different names")
    name = require_printable(table.get("name", ""), f"{label}: name")
    sha256 = require_printable(table.get("sha256", ""), f"{label}: sha256", SHA256_LENGTH)
    return file, (name, sha256, dict(frames))


def _parse_frame(value: object, label: str, layout: Layout) -> tuple[str, Frame | tuple[str, str]]:
    if not isinstance(value, dict):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a table: {FORMS}")
    try:
        if isinstance(value.get("A"), str):  # arrays of a moving frame
            table = require_table(value, label, ("name", "A", "b"))
            arrays = require_printable(table["A"], "A"), require_printable(table["b"], "b")
            return require_name(table["name"], "the name of a frame"), arrays
        given = parse_frame(value, layout)
        if len(given.b) != layout.width:
            raise InvalidInput(
                f"frame {given.name!r}: A and b are {len(given.b)} wide, expected the width of the layout: "
                f"{layout.width} columns"
            )
        return given.name, given
    except InvalidInput as error:
        known = str(error).startswith(label)
        raise InvalidInput(str(error) if known else f"{label}: {error}") from error


def _require_list(value: object, label: str) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a list")
    return value
