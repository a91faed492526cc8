"""The file that says what a folder of demonstrations holds: demonstrations.toml or demonstrations.json."""

import hashlib
import json
import tomllib
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from pilotfish.demonstrations import Frame, frame, frame_from_pose
from pilotfish.demonstrations.layouts import (
    MAX_COLUMNS,
    MAX_DERIVATIVE,
    Layout,
    Part,
    Quantity,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, pose
from pilotfish.io.manifest_fields import require_list, require_table
from pilotfish.validation import (
    finite_array,
    first_duplicate,
    require_count,
    require_name,
    require_period,
    require_printable,
    short_repr,
)

FORMAT, VERSION = "pilotfish demonstrations", 1
MANIFEST_NAMES = ("demonstrations.toml", "demonstrations.json")
TABLE_SUFFIXES = (".csv", ".npz")
MAX_MANIFEST_BYTES = 2**24  # bytes
MAX_DEMONSTRATIONS = 10_000
MAX_FRAME_ENTRIES = 2**26  # in the matrices of all frames; a demonstration without one has the world's
SHA256_LENGTH = 64  # digits


@dataclass(frozen=True, slots=True)
class MovingFrameKeys:
    """A moving frame whose arrays lie in the demonstration's NPZ file under these names."""

    name: str
    A: str
    b: str


@dataclass(frozen=True, slots=True, eq=False)
class DemonstrationEntry:
    """One demonstration of the folder. An empty sha256 was not given."""

    name: str
    file: str
    sha256: str
    frames: tuple[Frame | MovingFrameKeys, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Manifest:
    """What a folder holds; period [s]."""

    period: float
    layout: Layout
    entries: tuple[DemonstrationEntry, ...]


def parse_manifest(data: bytes, name: str) -> Manifest:
    """The manifest in these bytes, TOML or JSON as the name ends.

    Raises: InvalidInput, naming the key and the nearest fix.
    """
    content = _content(data, name)
    _require_format(content, name)
    top = require_table(
        content, name, ("format", "version", "period", "layout", "demonstration"), ("sha256",)
    )
    _require_checksum(top, name)
    layout = _layout(top["layout"], f"{name}: layout")
    listed = require_list(top["demonstration"], f"{name}: demonstration")
    _require_size(listed, layout, name)
    entries = [_entry(value, f"{name}: demonstration {m}", layout) for m, value in enumerate(listed)]
    if not entries:
        raise InvalidInput(f"{name}: demonstration is empty, expected at least one")
    if duplicate := first_duplicate(entry.file for entry in entries):
        raise InvalidInput(f"{name}: file {duplicate!r} is named more than once, expected a file for each")
    return Manifest(require_period(top["period"], f"{name}: period"), layout, tuple(entries))


def serialise_manifest(content: dict[str, Any]) -> bytes:
    """The bytes of demonstrations.json, with the format, the version and a checksum of its own."""
    mapping = {"format": FORMAT, "version": VERSION, **content}
    signed = {**mapping, "sha256": content_hash(mapping)}
    lines = [f"  {json.dumps(key)}: {_format_list(value)}" for key, value in signed.items()]
    data = ("{\n" + ",\n".join(lines) + "\n}\n").encode()
    if len(data) > MAX_MANIFEST_BYTES:
        raise InvalidInput(
            f"the manifest would have {len(data)} bytes, expected at most {MAX_MANIFEST_BYTES}; write the "
            "demonstrations to several folders"
        )
    return data


def layout_to_dicts(layout: Layout) -> list[dict[str, Any]]:
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


def content_hash(content: dict[str, Any]) -> str:
    """The sha256 of what a manifest says, however it is indented; its own key sha256 left out."""
    mapping = {key: value for key, value in content.items() if key != "sha256"}
    canonical = json.dumps(mapping, sort_keys=True, separators=(",", ":"), default=repr)
    return hashlib.sha256(canonical.encode()).hexdigest()


def _format_list(value: object) -> str:
    if not isinstance(value, list):
        return json.dumps(value)
    return "[\n    " + ",\n    ".join(map(json.dumps, value)) + "\n  ]"


def _content(data: bytes, name: str) -> object:
    try:
        characters = data.decode("utf-8-sig")
        if name.endswith(".toml"):
            return tomllib.loads(characters)
        return json.loads(characters, object_pairs_hook=_require_unique_keys)
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from error
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{name}: byte {error.start} is no UTF-8 text; save the file as UTF-8") from error
    except (ValueError, RecursionError) as error:  # syntax errors of both, and numbers too long to be any
        kind = "TOML" if name.endswith(".toml") else "JSON"
        raise InvalidInput(f"{name}: not {kind} that can be read: {error}") from error


def _require_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        duplicate = first_duplicate(key for key, _ in pairs)
        raise InvalidInput(f"key {short_repr(duplicate)} stands more than once in one table; keep one")
    return table


def _require_size(listed: list[Any], layout: Layout, name: str) -> None:
    """Raise InvalidInput before frames are made that would not fit in memory."""
    require_count(len(listed), f"{name}: the number of demonstrations", MAX_DEMONSTRATIONS)
    counts = [
        len(require_list)
        for one in listed
        if isinstance(one, dict) and isinstance(require_list := one.get("frames"), list)
    ]
    frames = sum(max(1, count) for count in counts) + len(listed) - len(counts)
    if frames * layout.width**2 > MAX_FRAME_ENTRIES:
        raise InvalidInput(
            f"{name}: the matrices of {frames} frames of {layout.width} columns have "
            f"{frames * layout.width**2} numbers, expected at most {MAX_FRAME_ENTRIES}; use several folders"
        )


def _require_format(content: object, name: str) -> None:
    mapping = content if isinstance(content, dict) else {}
    if mapping.get("format") != FORMAT:
        raise InvalidInput(
            f'{name}: format is {short_repr(mapping.get("format"))}, expected format = "{FORMAT}"'
        )
    version = require_count(mapping.get("version"), f"{name}: version", 2**31, -(2**31))
    if version > VERSION:
        raise InvalidInput(
            f"{name}: written by a newer pilotfish (version {version}, this one reads {VERSION}); upgrade it"
        )
    if version != VERSION:
        raise InvalidInput(f"{name}: version is {version}, expected {VERSION}")


def _require_checksum(top: dict[str, Any], name: str) -> None:
    if "sha256" not in top:
        return
    try:
        now = content_hash(top)
    except (ValueError, RecursionError) as error:  # numbers with more digits than Python prints
        raise InvalidInput(f"{name}: its sha256 cannot be checked: {error}") from error
    if top["sha256"] != now:
        raise InvalidInput(
            f"{name}: changed since pilotfish wrote it: its sha256 is {now}, the one written in it "
            f"{short_repr(top['sha256'], 70)}; if the change is meant, delete the key sha256 at the top"
        )


def _layout(value: object, label: str) -> Layout:
    parts = [_convert_part(item, f"{label} {n}") for n, item in enumerate(require_list(value, label))]
    try:
        return Layout(tuple(parts))
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _convert_part(value: object, label: str) -> Part:
    mapping = require_table(value, label, ("name", "quantity", "size", "unit"), ("derivative",))
    kinds = [quantity.value for quantity in Quantity]
    if mapping["quantity"] not in kinds:
        found = short_repr(mapping["quantity"])
        raise InvalidInput(f"{label}: quantity is {found}, expected one of {', '.join(kinds)}")
    size = require_count(mapping["size"], f"{label}: size", MAX_COLUMNS, 1)
    derivative = require_count(mapping.get("derivative", 0), f"{label}: derivative", MAX_DERIVATIVE)
    unit = require_printable(mapping["unit"], f"{label}: unit")
    try:
        name = require_name(mapping["name"], "the name of a part")
        return Part(name, Quantity(mapping["quantity"]), size, unit, derivative)
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _entry(value: object, label: str, layout: Layout) -> DemonstrationEntry:
    mapping = require_table(value, label, ("file",), ("name", "sha256", "frames"))
    file = require_printable(mapping["file"], f"{label}: file")
    path = PurePath(file)
    if path.name != file or "\\" in file or path.suffix not in TABLE_SUFFIXES:
        raise InvalidInput(
            f"{label}: file is {file!r}, expected the name of a .csv or .npz file in this folder"
        )
    listed = require_list(mapping.get("frames", []), f"{label}: frames")
    frames = [_frame(item, f"{label}, frame {n}", layout) for n, item in enumerate(listed)]
    if duplicate := first_duplicate(given.name for given in frames):
        raise InvalidInput(f"{label}: two frames are named {duplicate!r}, expected different names")
    name = require_printable(mapping.get("name", ""), f"{label}: name")
    sha256 = require_printable(mapping.get("sha256", ""), f"{label}: sha256", SHA256_LENGTH)
    return DemonstrationEntry(name, file, sha256, tuple(frames))


def _frame(value: object, label: str, layout: Layout) -> Frame | MovingFrameKeys:
    by_pose = isinstance(value, dict) and ("position" in value or "quaternion" in value)
    needed = ("name", "position", "quaternion") if by_pose else ("name", "A", "b")
    mapping = require_table(value, label, needed, ())
    try:
        name = require_name(mapping["name"], "the name of a frame")
        if by_pose:
            return frame_from_pose(name, layout, _pose(mapping))
        if isinstance(mapping["A"], str):
            return MovingFrameKeys(
                name, require_printable(mapping["A"], "A"), require_printable(mapping["b"], "b")
            )
        return _require_width(frame(name, mapping["A"], mapping["b"]), layout)
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _pose(mapping: dict[str, Any]) -> Pose:
    return pose(*(finite_array(mapping[key], key) for key in ("position", "quaternion")))


def _require_width(given: Frame, layout: Layout) -> Frame:
    if len(given.b) != layout.width:
        raise InvalidInput(
            f"frame {given.name!r}: A and b are {len(given.b)} wide, expected as wide as the layout: "
            f"{layout.width} columns"
        )
    return given
