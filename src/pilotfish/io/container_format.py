"""Safetensors files with one JSON header in their metadata: the format, what it tells, the hash of it all."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pilotfish.errors import InvalidInput, SkillError, UnreadableFile
from pilotfish.io.atomic_writes import atomic_file
from pilotfish.io.paths import is_link, path_exists, read_file
from pilotfish.io.skill_fields import Arrays, pop_field
from pilotfish.types import Array
from pilotfish.validation import MAX_NAME_LENGTH, short_repr

METADATA_KEY = "pilotfish"
MAX_FILE_BYTES = 2**28  # bytes; reading one takes some three times as much memory
MAX_ARRAY_DIMENSIONS = 8  # of an array
T = TypeVar("T")

Header = dict[str, Any]


@dataclass(frozen=True, slots=True)
class ContainerFormat:
    """What a header says of its file; version is the newest that this pilotfish reads."""

    name: str
    version: int


SKILL_FORMAT = ContainerFormat("pilotfish-skill", 1)
STREAM_FORMAT = ContainerFormat("pilotfish-stream", 2)
# What to do with a file of one kind where another is expected.
WRONG_FORMAT_HINTS = {
    SKILL_FORMAT.name: "it is a skill: open_skill opens it, `pilotfish show` shows it",
    STREAM_FORMAT.name: "it is a model that grows with a stream: open_stream opens it, `pilotfish show` shows it, "
    "and `pilotfish stream /dev/null --resume FILE --skill NEW` writes the skill that it is",
}


def encode_container(kind: ContainerFormat, header: Header, arrays: Arrays) -> bytes:
    """The bytes of a file: the same for equal headers and arrays."""
    from safetensors.numpy import save  # slow to import

    header = {"format": kind.name, "version": kind.version, **header}
    data = bytes(
        save(arrays, {METADATA_KEY: canonical_json(header | {"content": _hash_contents(header, arrays)})})
    )
    if len(data) > MAX_FILE_BYTES:
        raise InvalidInput(f"the file would have {len(data)} bytes, expected at most {MAX_FILE_BYTES}")
    return data


def container_hash(kind: ContainerFormat, header: Header, arrays: Arrays) -> str:
    """The hash that stands in the file of these."""
    return _hash_contents({"format": kind.name, "version": kind.version, **header}, arrays)


def decode_container(kind: ContainerFormat, data: bytes, build: Callable[[Header, Arrays], T]) -> T:
    """What build makes of the header and the arrays that encoded was given.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version, or when
    build refuses what it holds.
    """
    text, arrays = _unpack(data)
    try:
        header = json.loads(text)
        _validate_format(kind, header)
        _verify_hash(header, arrays)
        del header["format"], header["version"]
        return build(header, arrays)
    except UnreadableFile:
        raise
    except (SkillError, ValueError, RecursionError) as error:
        raise UnreadableFile(f"the header cannot be used: {error}") from error


def read_format_name(data: bytes) -> str | None:
    """The name of the format that the header gives, none of it checked.    Raises: UnknownSkill."""
    text, _ = _unpack(data)
    try:
        header = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
    name = header.get("format") if isinstance(header, dict) else None
    return name if isinstance(name, str) else None


def write_container(data: bytes, path: str | Path, *, overwrite: bool, use_free_name: bool) -> None:
    """Write a file as a whole, or leave what is there.    Raises: InvalidInput, NameTaken."""
    if not (overwrite or use_free_name) and (path_exists(path) or is_link(path)):
        raise InvalidInput(f"{path} exists; choose another name, or pass overwrite=True")
    with atomic_file(path, overwrite=overwrite) as part:
        part.write_bytes(data)


def read_container(path: str | Path, expected: str, decode: Callable[[bytes], T]) -> T:
    """What decode makes of the file.

    Raises: UnknownSkill, with the file's name; InvalidInput, when there is none that can be read.
    """
    data = read_file(path, f"a {expected} file", MAX_FILE_BYTES)
    try:
        return decode(data)
    except UnreadableFile as error:
        raise UnreadableFile(f"{path}: {error}") from error


def canonical_json(value: object) -> str:
    """JSON that is the same for equal values: keys in order, no blanks, ASCII alone."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _unpack(data: bytes) -> tuple[str, Arrays]:
    """The header's text and the arrays of a safetensors file, its checksum not yet looked at."""
    import safetensors  # slow to import

    try:
        tensors = safetensors.deserialize(data)  # type: ignore[no-untyped-call]
        length = int.from_bytes(data[:8], "little")
        text = json.loads(data[8 : 8 + length])["__metadata__"][METADATA_KEY]
    except safetensors.SafetensorError as error:
        raise UnreadableFile(f"no safetensors file, or not all of one: {error}") from error
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise UnreadableFile(
            f"a safetensors file without the header of a skill or online model ({METADATA_KEY!r})"
        ) from error
    return text, {name: _decode_array(name, tensor) for name, tensor in tensors}


def _decode_array(name: str, tensor: dict[str, Any]) -> Array:
    if not name.isprintable() or len(name) > MAX_NAME_LENGTH:
        raise UnreadableFile(f"the name of an array is {short_repr(name)}, expected a short printable one")
    if tensor["dtype"] != "F64" or len(tensor["shape"]) > MAX_ARRAY_DIMENSIONS:
        found = f"{tensor['dtype']} in {len(tensor['shape'])} dimensions"
        raise UnreadableFile(f"{name} holds {found}, expected F64 in at most {MAX_ARRAY_DIMENSIONS}")
    try:
        return np.frombuffer(tensor["data"], dtype="<f8").astype(np.float64).reshape(tensor["shape"])
    except ValueError as error:  # no number in it, in a shape that no array has
        raise UnreadableFile(f"{name} has a shape that no array has: {error}") from error


def _validate_format(kind: ContainerFormat, header: Any) -> None:
    fields = header if isinstance(header, dict) else {}
    if (name := fields.get("format")) != kind.name:
        remedy = (
            f"; {WRONG_FORMAT_HINTS[name]}" if isinstance(name, str) and name in WRONG_FORMAT_HINTS else ""
        )
        raise UnreadableFile(f"its format is {short_repr(name)}, expected {kind.name!r}{remedy}")
    version = fields.get("version")
    if type(version) is not int or version < 1:
        raise UnreadableFile(f"its format's version is {short_repr(version)}, expected {kind.version}")
    if version > kind.version:
        raise UnreadableFile(
            f"written by a newer pilotfish (format {short_repr(version)}, this one reads {kind.version}); "
            "upgrade pilotfish"
        )
    if version < kind.version:
        raise UnreadableFile(
            f"written by an older pilotfish (format {version}, this one reads {kind.version}); learn it again "
            "from the demonstrations or the stream"
        )


def _verify_hash(header: Header, arrays: Arrays) -> None:
    stored_hash = pop_field(header, "content", "the header")
    if stored_hash != (actual_hash := _hash_contents(header, arrays)):
        raise UnreadableFile(
            f"the file was altered: its content has the hash {actual_hash}, the one written in it is "
            f"{short_repr(stored_hash, 70)}; "
            "fetch or learn the skill again"
        )


def _hash_contents(header: Header, arrays: Arrays) -> str:
    digest = hashlib.sha256(canonical_json(header).encode())
    for name in sorted(arrays):
        digest.update(canonical_json([name, "F64", arrays[name].shape]).encode())
        digest.update(arrays[name].astype("<f8").tobytes())
    return digest.hexdigest()
