"""The file that says what a folder of demonstrations holds: demonstrations.toml or demonstrations.json."""

import hashlib
import json
import tomllib
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from pilotfish.demonstrations.fields import fields, items, number, text, whole
from pilotfish.demonstrations.frame_doors import frame
from pilotfish.demonstrations.frames import Frame, frame_from_pose
from pilotfish.demonstrations.layouts import Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose
from pilotfish.validation import finite_array

FORMAT, VERSION = "pilotfish demonstrations", 1
NAMES = ("demonstrations.toml", "demonstrations.json")
ENDINGS = (".csv", ".npz")


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
    entries = [_entry(value, f"{name}: demonstration {m}", layout) for m, value in enumerate(listed)]
    if not entries:
        raise InvalidInput(f"{name}: demonstration is empty, expected at least one")
    files = [entry.file for entry in entries]
    if twice := [file for file in files if files.count(file) > 1]:
        raise InvalidInput(f"{name}: file {twice[0]!r} is named more than once, expected a file for each")
    return Manifest(_period(top["period"], f"{name}: period"), layout, tuple(entries))


def written_manifest(content: dict[str, Any]) -> bytes:
    """The bytes of demonstrations.json, with the format, the version and a checksum of its own."""
    said = {"format": FORMAT, "version": VERSION, **content}
    signed = {**said, "sha256": content_hash(said)}
    lines = [f"  {json.dumps(key)}: {_one_item_a_line(value)}" for key, value in signed.items()]
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


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
    keys = [key for key, _ in pairs]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise InvalidInput(f"key {twice[0]!r} stands more than once in one table; keep one")
    return dict(pairs)


def _refuse_other_formats(content: object, name: str) -> None:
    said = content if isinstance(content, dict) else {}
    if said.get("format") != FORMAT:
        raise InvalidInput(f'{name}: format is {said.get("format")!r}, expected format = "{FORMAT}"')
    version = whole(said.get("version"), f"{name}: version")
    if version > VERSION:
        raise InvalidInput(
            f"{name}: written by a newer pilotfish (version {version}, this one reads {VERSION}); upgrade it"
        )
    if version != VERSION:
        raise InvalidInput(f"{name}: version is {version}, expected {VERSION}")


def _refuse_changed(top: dict[str, Any], name: str) -> None:
    if "sha256" in top and top["sha256"] != (now := content_hash(top)):
        raise InvalidInput(
            f"{name}: changed since pilotfish wrote it: its sha256 is {now}, the one written in it "
            f"{top['sha256']!r}; if the change is meant, delete the key sha256 at the top"
        )


def _period(value: object, place: str) -> float:
    period = number(value, place)
    if period <= 0.0:
        raise InvalidInput(f"{place} is {period} s, expected a positive number")
    return period


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
        raise InvalidInput(f"{place}: quantity is {said['quantity']!r}, expected one of {', '.join(kinds)}")
    size = whole(said["size"], f"{place}: size")
    derivative = whole(said.get("derivative", 0), f"{place}: derivative")
    name, unit = text(said["name"], f"{place}: name"), text(said["unit"], f"{place}: unit")
    try:
        return Part(name, Quantity(said["quantity"]), size, unit, derivative)
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _entry(value: object, place: str, layout: Layout) -> Entry:
    said = fields(value, place, ("file",), ("name", "sha256", "frames"))
    file = text(said["file"], f"{place}: file")
    path = PurePath(file)
    if path.name != file or "\\" in file or not file.isprintable() or path.suffix not in ENDINGS:
        raise InvalidInput(
            f"{place}: file is {file!r}, expected the name of a .csv or .npz file in this folder"
        )
    listed = items(said.get("frames", []), f"{place}: frames")
    frames = [_frame(item, f"{place}, frame {n}", layout) for n, item in enumerate(listed)]
    names = [given.name for given in frames]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput(f"{place}: two frames are named {twice[0]!r}, expected different names")
    name, sha256 = (
        text(said.get("name", ""), f"{place}: name"),
        text(said.get("sha256", ""), f"{place}: sha256"),
    )
    return Entry(name, file, sha256, tuple(frames))


def _frame(value: object, place: str, layout: Layout) -> Frame | FrameKeys:
    by_pose = isinstance(value, dict) and ("position" in value or "quaternion" in value)
    needed = ("name", "position", "quaternion") if by_pose else ("name", "A", "b")
    said = fields(value, place, needed, ())
    name = text(said["name"], f"{place}: name")
    try:
        if by_pose:
            return frame_from_pose(name, layout, pose(said["position"], said["quaternion"]))
        if isinstance(said["A"], str):
            return FrameKeys(name, said["A"], text(said["b"], f"{place}: b"))
        return _of_the_layout(frame(name, finite_array(said["A"], "A"), finite_array(said["b"], "b")), layout)
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _of_the_layout(given: Frame, layout: Layout) -> Frame:
    if len(given.b) != layout.width:
        raise InvalidInput(
            f"frame {given.name!r}: A and b are {len(given.b)} wide, expected as wide as the layout: "
            f"{layout.width} columns"
        )
    return given
