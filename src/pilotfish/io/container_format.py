"""Container of skill and stream files: a safetensors file with one JSON header in its metadata.

The header has the name and version of the format, a SHA-256 of header and arrays, and the fields of the
format. Equal content gives equal bytes and an equal hash on every machine, because JSON is written
canonically and arrays are little-endian float64. A reader trusts nothing: it checks structure, format,
version and hash before it decodes a field. Every fault raises `UnreadableFile`.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pilotfish.errors import InvalidInput, SkillError, UnreadableFile
from pilotfish.io.atomic_writes import atomic_file
from pilotfish.io.paths import path_exists, read_file
from pilotfish.io.skill_fields import Arrays, pop_field
from pilotfish.types import Array
from pilotfish.validation import MAX_NAME_LENGTH, short_repr

METADATA_KEY = "pilotfish"
MAX_FILE_BYTES = 2**28  # reading takes about three times as much memory
MAX_ARRAY_DIMENSIONS = 8
T = TypeVar("T")

Header = dict[str, Any]


SKILL_FORMAT = "pilotfish-skill"
STREAM_FORMAT = "pilotfish-stream"
VERSIONS = {SKILL_FORMAT: 3, STREAM_FORMAT: 3}  # that are written and read
RENEWALS = {  # how to replace a file of an older version
    SKILL_FORMAT: "learn the skill again",
    STREAM_FORMAT: "run `pilotfish stream` on the data again",
}
HINTS = {  # what to do with such a file where another format is expected
    SKILL_FORMAT: "it is a skill: read it with open_skill or `pilotfish show`",
    STREAM_FORMAT: "it is an online model: read it with open_stream or `pilotfish show`, or write its skill "
    "with `pilotfish stream /dev/null --resume FILE --skill NEW`",
}


def encode_container(format_name: str, header: Header, arrays: Arrays) -> bytes:
    """Return the bytes of a file; equal headers and arrays give equal bytes.

    Args:
        format_name: Format to write.
        header: Fields of the header, without format, version and hash.
        arrays: Arrays by name.

    Raises:
        InvalidInput: If the file would be too large to be read again.
    """
    from safetensors.numpy import save  # slow to import

    full_header = _with_format(format_name, header)
    content = {"content": _hash_content(full_header, arrays)}
    data = bytes(save(arrays, {METADATA_KEY: canonical_json(full_header | content)}))
    if len(data) > MAX_FILE_BYTES:
        raise InvalidInput(f"the file would have {len(data)} bytes, expected at most {MAX_FILE_BYTES}")
    return data


def container_hash(format_name: str, header: Header, arrays: Arrays) -> str:
    """Return the hash that a file with this header and these arrays has."""
    return _hash_content(_with_format(format_name, header), arrays)


def decode_container(format_name: str, data: bytes, build: Callable[[Header, Arrays], T]) -> T:
    """Return what build makes of the header and the arrays of a file.

    Args:
        format_name: Expected format.
        data: Content of the file.
        build: Function of the header, without format, version and hash, and of the arrays.

    Raises:
        UnreadableFile: If the file is damaged, altered, of another format or version, or build refuses it.
    """
    text, arrays = _unpack(data)
    try:
        header = json.loads(text)
        _validate_format(format_name, header)
        _verify_hash(header, arrays)
        del header["format"], header["version"]
        return build(header, arrays)
    except UnreadableFile:
        raise
    except (SkillError, ValueError, RecursionError) as error:
        raise UnreadableFile(f"the header cannot be used: {error}") from error


def read_format_name(data: bytes) -> str | None:
    """Return the format in a file's header without checking the rest; None if the header has none.

    Raises:
        UnreadableFile: If the file is not a safetensors file with a header.
    """
    text, _ = _unpack(data)
    try:
        header = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return None
    name = header.get("format") if isinstance(header, dict) else None
    return name if isinstance(name, str) else None


def write_container(data: bytes, path: str | Path, *, overwrite: bool, use_free_name: bool) -> None:
    """Write a file atomically.

    Args:
        data: Content of the file.
        path: File to write.
        overwrite: Whether an existing file may be replaced.
        use_free_name: Whether to write to a similar free name if it may not.

    Raises:
        InvalidInput: If path cannot be written, or exists and may not be replaced.
        OutputExists: If path exists and the result was written to another name.
    """
    if not (overwrite or use_free_name) and path_exists(path, follow_links=False):
        raise InvalidInput(f"{path} exists; choose another name, or pass overwrite=True")
    with atomic_file(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data)


def read_container(path: str | Path, expected: str, decode: Callable[[bytes], T]) -> T:
    """Return what decode makes of a file; messages begin with the path.

    Raises:
        UnreadableFile: If decode refuses the content.
        InvalidInput: If the file cannot be read.
    """
    data = read_file(path, f"a {expected} file", MAX_FILE_BYTES)
    try:
        return decode(data)
    except UnreadableFile as error:
        raise UnreadableFile(f"{path}: {error}") from error


def canonical_json(value: object) -> str:
    """Return JSON that is equal for equal values: sorted keys, no blanks, ASCII only."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _with_format(format_name: str, header: Header) -> Header:
    return {"format": format_name, "version": VERSIONS[format_name], **header}


def _unpack(data: bytes) -> tuple[str, Arrays]:
    """Return the text of the header and the arrays of a safetensors file; the hash is not checked."""
    import safetensors  # slow to import

    try:
        tensors = safetensors.deserialize(data)  # type: ignore[no-untyped-call]
        length = int.from_bytes(data[:8], "little")
        text = json.loads(data[8 : 8 + length])["__metadata__"][METADATA_KEY]
    except safetensors.SafetensorError as error:
        raise UnreadableFile(f"not a complete safetensors file: {error}; fetch or write it again") from error
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
    except ValueError as error:  # an empty array with a shape that NumPy does not allow
        raise UnreadableFile(f"{name} has an impossible shape: {error}") from error


def _validate_format(format_name: str, header: Any) -> None:
    fields = header if isinstance(header, dict) else {}
    if (name := fields.get("format")) != format_name:
        hint = f"; {HINTS[name]}" if isinstance(name, str) and name in HINTS else ""
        raise UnreadableFile(f"its format is {short_repr(name)}, expected {format_name!r}{hint}")
    version, expected = fields.get("version"), VERSIONS[format_name]
    if type(version) is not int or version < 1:
        raise UnreadableFile(f"its version is {short_repr(version)}, expected {expected}")
    if version < expected:
        raise UnreadableFile(f"was written by an older version (format {version}); {RENEWALS[format_name]}")
    if version > expected:
        raise UnreadableFile(
            f"was written by a newer version (format {short_repr(version)}, this one reads {expected}); "
            "upgrade pilotfish"
        )


def _verify_hash(header: Header, arrays: Arrays) -> None:
    stored_hash = pop_field(header, "content", "the header")
    if stored_hash != (actual_hash := _hash_content(header, arrays)):
        raise UnreadableFile(
            f"the file was altered: its content has the hash {actual_hash}, expected "
            f"{short_repr(stored_hash, 70)}; fetch it again or write it again"
        )


def _hash_content(header: Header, arrays: Arrays) -> str:
    digest = hashlib.sha256(canonical_json(header).encode())
    for name in sorted(arrays):
        digest.update(canonical_json([name, "F64", arrays[name].shape]).encode())
        digest.update(arrays[name].astype("<f8").tobytes())
    return digest.hexdigest()
