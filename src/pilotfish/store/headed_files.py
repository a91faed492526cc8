"""Safetensors files with one JSON header in their metadata: the format, what it tells, the hash of it all."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pilotfish.errors import InvalidInput, SkillError, UnknownSkill
from pilotfish.files import whole_file
from pilotfish.store.skills_fields import Arrays, taken
from pilotfish.types import Array
from pilotfish.validation import LONGEST_NAME, is_link, path_exists, read_file, short_repr

KEY = "pilotfish"
LARGEST_HEADED_FILE = 2**28  # bytes; reading one takes some three times as much memory
MOST_DIMENSIONS = 8  # of an array
T = TypeVar("T")

Header = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Format:
    """What a header says of its file; version is the newest that this pilotfish reads."""

    name: str
    version: int


SKILL = Format("pilotfish-skill", 1)
STREAM = Format("pilotfish-stream", 1)
# What to do with a file of one kind where another is expected.
REMEDIES = {
    SKILL.name: "it is a skill: open_skill opens it, `pilotfish show` shows it",
    STREAM.name: "it is a model that grows with a stream: open_stream opens it, `pilotfish show` shows it, "
    "and `pilotfish stream /dev/null --resume FILE --skill NEW` writes the skill that it is",
}


def encoded(kind: Format, header: Header, arrays: Arrays) -> bytes:
    """The bytes of a file: the same for equal headers and arrays."""
    from safetensors.numpy import save  # slow to import

    header = {"format": kind.name, "version": kind.version, **header}
    data = bytes(save(arrays, {KEY: canonical(header | {"content": _hash(header, arrays)})}))
    if len(data) > LARGEST_HEADED_FILE:
        raise InvalidInput(f"the file would have {len(data)} bytes, expected at most {LARGEST_HEADED_FILE}")
    return data


def content_of(kind: Format, header: Header, arrays: Arrays) -> str:
    """The hash that stands in the file of these."""
    return _hash({"format": kind.name, "version": kind.version, **header}, arrays)


def decoded(kind: Format, data: bytes, build: Callable[[Header, Arrays], T]) -> T:
    """What build makes of the header and the arrays that encoded was given.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version, or when
    build refuses what it holds.
    """
    text, arrays = _unpacked(data)
    try:
        header = json.loads(text)
        _require_known(kind, header)
        _require_unaltered(header, arrays)
        del header["format"], header["version"]
        return build(header, arrays)
    except UnknownSkill:
        raise
    except (SkillError, ValueError, RecursionError) as error:
        raise UnknownSkill(f"the header cannot be used: {error}") from error


def format_name(data: bytes) -> str | None:
    """The name of the format that the header gives, none of it checked.    Raises: UnknownSkill."""
    text, _ = _unpacked(data)
    try:
        header = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
    name = header.get("format") if isinstance(header, dict) else None
    return name if isinstance(name, str) else None


def written(data: bytes, path: str | Path, *, overwrite: bool, beside: bool) -> None:
    """Write a file as a whole, or leave what is there.    Raises: InvalidInput, NameTaken."""
    if not (overwrite or beside) and (path_exists(path) or is_link(path)):
        raise InvalidInput(f"{path} exists; choose another name, or say overwrite=True")
    with whole_file(path, overwrite=overwrite) as part:
        part.write_bytes(data)


def opened(path: str | Path, expected: str, decode: Callable[[bytes], T]) -> T:
    """What decode makes of the file.

    Raises: UnknownSkill, with the file's name; InvalidInput, when there is none that can be read.
    """
    data = read_file(path, f"a {expected} file", LARGEST_HEADED_FILE)
    try:
        return decode(data)
    except UnknownSkill as error:
        raise UnknownSkill(f"{path}: {error}") from error


def canonical(value: object) -> str:
    """JSON that is the same for equal values: keys in order, no blanks, ASCII alone."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _unpacked(data: bytes) -> tuple[str, Arrays]:
    """The header's text and the arrays of a safetensors file, its checksum not yet looked at."""
    import safetensors  # slow to import

    try:
        tensors = safetensors.deserialize(data)  # type: ignore[no-untyped-call]
        length = int.from_bytes(data[:8], "little")
        text = json.loads(data[8 : 8 + length])["__metadata__"][KEY]
    except safetensors.SafetensorError as error:
        raise UnknownSkill(f"no safetensors file, or not all of one: {error}") from error
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise UnknownSkill(f"a safetensors file without the header of a skill or stream ({KEY!r})") from error
    return text, {name: _array(name, tensor) for name, tensor in tensors}


def _array(name: str, tensor: dict[str, Any]) -> Array:
    if not name.isprintable() or len(name) > LONGEST_NAME:
        raise UnknownSkill(f"the name of an array is {short_repr(name)}, expected a short printable one")
    if tensor["dtype"] != "F64" or len(tensor["shape"]) > MOST_DIMENSIONS:
        found = f"{tensor['dtype']} in {len(tensor['shape'])} dimensions"
        raise UnknownSkill(f"{name} holds {found}, expected F64 in at most {MOST_DIMENSIONS}")
    try:
        return np.frombuffer(tensor["data"], dtype="<f8").astype(np.float64).reshape(tensor["shape"])
    except ValueError as error:  # no number in it, in a shape that no array has
        raise UnknownSkill(f"{name} has a shape that no array has: {error}") from error


def _require_known(kind: Format, header: Any) -> None:
    said = header if isinstance(header, dict) else {}
    if (name := said.get("format")) != kind.name:
        remedy = f"; {REMEDIES[name]}" if isinstance(name, str) and name in REMEDIES else ""
        raise UnknownSkill(f"its format is {short_repr(name)}, expected {kind.name!r}{remedy}")
    version = said.get("version")
    if type(version) is not int or version < 1:
        raise UnknownSkill(f"its format's version is {short_repr(version)}, expected {kind.version}")
    if version > kind.version:
        raise UnknownSkill(
            f"written by a newer pilotfish (format {short_repr(version)}, this one reads {kind.version}); "
            "upgrade pilotfish"
        )


def _require_unaltered(header: Header, arrays: Arrays) -> None:
    told = taken(header, "content", "the header")
    if told != (now := _hash(header, arrays)):
        raise UnknownSkill(
            f"the file was altered: its content has the hash {now}, the one written in it is "
            f"{short_repr(told, 70)}; "
            "fetch or learn the skill again"
        )


def _hash(header: Header, arrays: Arrays) -> str:
    digest = hashlib.sha256(canonical(header).encode())
    for name in sorted(arrays):
        digest.update(canonical([name, "F64", arrays[name].shape]).encode())
        digest.update(arrays[name].astype("<f8").tobytes())
    return digest.hexdigest()
