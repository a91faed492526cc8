"""The file that says what a folder of demonstrations holds: demonstrations.toml or demonstrations.json."""

import hashlib
import json
import tomllib
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from pilotfish.demonstrations.fields import fields, items
from pilotfish.demonstrations.frame_doors import frame
from pilotfish.demonstrations.frames import Frame, frame_from_pose
from pilotfish.demonstrations.layouts import (
    HIGHEST_DERIVATIVE,
    MOST_COLUMNS,
    Layout,
    Part,
    Quantity,
    require_name,
)
from pilotfish.demonstrations.recording import require_period
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, pose
from pilotfish.validation import (
    finite_array,
    first_repeated,
    require_count,
    require_printable,
    short_repr,
)

FORMAT, VERSION = "pilotfish demonstrations", 1
NAMES = ("demonstrations.toml", "demonstrations.json")
ENDINGS = (".csv", ".npz")
LARGEST_MANIFEST = 2**24  # bytes
MOST_DEMONSTRATIONS = 10_000
MOST_FRAME_NUMBERS = 2**26  # in the matrices of all frames; a demonstration without one has the world's
SHA256 = 64  # digits


@dataclass(frozen=True, slots=True)
class FrameKeys:
    """A moving frame whose arrays lie in the demonstration's NPZ file under these names."""

    name: str
    A: str
    b: str


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One demonstration of the folder. An empty sha256 was not given."""

    name: str
    file: str
    sha256: str
    frames: tuple[Frame | FrameKeys, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Manifest:
    """What a folder holds; period [s]."""

    period: float
    layout: Layout
    entries: tuple[Entry, ...]


def parsed_manifest(data: bytes, name: str) -> Manifest:
    """The manifest in these bytes, TOML or JSON as the name ends.

    Raises: InvalidInput, naming the key and the nearest fix.
    """
    content = _content(data, name)
    _refuse_other_formats(content, name)
    top = fields(content, name, ("format", "version", "period", "layout", "demonstration"), ("sha256",))
    _refuse_changed(top, name)
    layout = _layout(top["layout"], f"{name}: layout")
    listed = items(top["demonstration"], f"{name}: demonstration")
    _refuse_large(listed, layout, name)
    entries = [_entry(value, f"{name}: demonstration {m}", layout) for m, value in enumerate(listed)]
    if not entries:
        raise InvalidInput(f"{name}: demonstration is empty, expected at least one")
    if twice := first_repeated(entry.file for entry in entries):
        raise InvalidInput(f"{name}: file {twice!r} is named more than once, expected a file for each")
    return Manifest(require_period(top["period"], f"{name}: period"), layout, tuple(entries))


def written_manifest(content: dict[str, Any]) -> bytes:
    """The bytes of demonstrations.json, with the format, the version and a checksum of its own."""
    said = {"format": FORMAT, "version": VERSION, **content}
    signed = {**said, "sha256": content_hash(said)}
    lines = [f"  {json.dumps(key)}: {_one_item_a_line(value)}" for key, value in signed.items()]
    data = ("{\n" + ",\n".join(lines) + "\n}\n").encode()
    if len(data) > LARGEST_MANIFEST:
        raise InvalidInput(
            f"the manifest would have {len(data)} bytes, expected at most {LARGEST_MANIFEST}; write the "
            "demonstrations to several folders"
        )
    return data


def layout_fields(layout: Layout) -> list[dict[str, Any]]:
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
    said = {key: value for key, value in content.items() if key != "sha256"}
    canonical = json.dumps(said, sort_keys=True, separators=(",", ":"), default=repr)
    return hashlib.sha256(canonical.encode()).hexdigest()


def _one_item_a_line(value: object) -> str:
    if not isinstance(value, list):
        return json.dumps(value)
    return "[\n    " + ",\n    ".join(map(json.dumps, value)) + "\n  ]"


def _content(data: bytes, name: str) -> object:
    try:
        characters = data.decode("utf-8-sig")
        if name.endswith(".toml"):
            return tomllib.loads(characters)
        return json.loads(characters, object_pairs_hook=_without_twins)
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from error
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{name}: byte {error.start} is no UTF-8 text; save the file as UTF-8") from error
    except (ValueError, RecursionError) as error:  # syntax errors of both, and numbers too long to be any
        kind = "TOML" if name.endswith(".toml") else "JSON"
        raise InvalidInput(f"{name}: not {kind} that can be read: {error}") from error


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice = first_repeated(key for key, _ in pairs)
        raise InvalidInput(f"key {short_repr(twice)} stands more than once in one table; keep one")
    return table


def _refuse_large(listed: list[Any], layout: Layout, name: str) -> None:
    """Raise InvalidInput before frames are made that would not fit in memory."""
    require_count(len(listed), f"{name}: the number of demonstrations", MOST_DEMONSTRATIONS)
    counts = [
        len(items) for one in listed if isinstance(one, dict) and isinstance(items := one.get("frames"), list)
    ]
    frames = sum(max(1, count) for count in counts) + len(listed) - len(counts)
    if frames * layout.width**2 > MOST_FRAME_NUMBERS:
        raise InvalidInput(
            f"{name}: the matrices of {frames} frames of {layout.width} columns have "
            f"{frames * layout.width**2} numbers, expected at most {MOST_FRAME_NUMBERS}; use several folders"
        )


def _refuse_other_formats(content: object, name: str) -> None:
    said = content if isinstance(content, dict) else {}
    if said.get("format") != FORMAT:
        raise InvalidInput(
            f'{name}: format is {short_repr(said.get("format"))}, expected format = "{FORMAT}"'
        )
    version = require_count(said.get("version"), f"{name}: version", 2**31, -(2**31))
    if version > VERSION:
        raise InvalidInput(
            f"{name}: written by a newer pilotfish (version {version}, this one reads {VERSION}); upgrade it"
        )
    if version != VERSION:
        raise InvalidInput(f"{name}: version is {version}, expected {VERSION}")


def _refuse_changed(top: dict[str, Any], name: str) -> None:
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


def _layout(value: object, place: str) -> Layout:
    parts = [_part(item, f"{place} {n}") for n, item in enumerate(items(value, place))]
    try:
        return Layout(tuple(parts))
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _part(value: object, place: str) -> Part:
    said = fields(value, place, ("name", "quantity", "size", "unit"), ("derivative",))
    kinds = [quantity.value for quantity in Quantity]
    if said["quantity"] not in kinds:
        found = short_repr(said["quantity"])
        raise InvalidInput(f"{place}: quantity is {found}, expected one of {', '.join(kinds)}")
    size = require_count(said["size"], f"{place}: size", MOST_COLUMNS, 1)
    derivative = require_count(said.get("derivative", 0), f"{place}: derivative", HIGHEST_DERIVATIVE)
    unit = require_printable(said["unit"], f"{place}: unit")
    try:
        name = require_name(said["name"], "a part")
        return Part(name, Quantity(said["quantity"]), size, unit, derivative)
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _entry(value: object, place: str, layout: Layout) -> Entry:
    said = fields(value, place, ("file",), ("name", "sha256", "frames"))
    file = require_printable(said["file"], f"{place}: file")
    path = PurePath(file)
    if path.name != file or "\\" in file or path.suffix not in ENDINGS:
        raise InvalidInput(
            f"{place}: file is {file!r}, expected the name of a .csv or .npz file in this folder"
        )
    listed = items(said.get("frames", []), f"{place}: frames")
    frames = [_frame(item, f"{place}, frame {n}", layout) for n, item in enumerate(listed)]
    if twice := first_repeated(given.name for given in frames):
        raise InvalidInput(f"{place}: two frames are named {twice!r}, expected different names")
    name = require_printable(said.get("name", ""), f"{place}: name")
    sha256 = require_printable(said.get("sha256", ""), f"{place}: sha256", SHA256)
    return Entry(name, file, sha256, tuple(frames))


def _frame(value: object, place: str, layout: Layout) -> Frame | FrameKeys:
    by_pose = isinstance(value, dict) and ("position" in value or "quaternion" in value)
    needed = ("name", "position", "quaternion") if by_pose else ("name", "A", "b")
    said = fields(value, place, needed, ())
    try:
        name = require_name(said["name"], "a frame")
        if by_pose:
            return frame_from_pose(name, layout, _pose(said))
        if isinstance(said["A"], str):
            return FrameKeys(name, require_printable(said["A"], "A"), require_printable(said["b"], "b"))
        return _of_the_layout(frame(name, said["A"], said["b"]), layout)
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _pose(said: dict[str, Any]) -> Pose:
    return pose(*(finite_array(said[key], key) for key in ("position", "quaternion")))


def _of_the_layout(given: Frame, layout: Layout) -> Frame:
    if len(given.b) != layout.width:
        raise InvalidInput(
            f"frame {given.name!r}: A and b are {len(given.b)} wide, expected as wide as the layout: "
            f"{layout.width} columns"
        )
    return given
