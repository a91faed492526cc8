"""Skill and stream files as a header and arrays, written with a valid hash after an edit."""

import json
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
from safetensors import deserialize

from fuzzing.edits import edit_tree, json_text, short_text
from fuzzing.edits_of_arrays import edit_array
from fuzzing.edits_of_text import edit_bytes
from pilotfish.io.container_format import METADATA_KEY, container_hash
from pilotfish.types import Array

Container = tuple[dict[str, Any], dict[str, Array], tuple[int, ...]]  # header, arrays, seeds of damage
NAMES = {"f8": "F64", "f4": "F32", "f2": "F16", "i8": "I64", "i4": "I32", "u1": "U8", "b1": "BOOL"}


def parse_container(data: bytes) -> Container:
    """Return the header and the arrays of a valid file."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(json.loads(data[8 : 8 + length])["__metadata__"][METADATA_KEY])
    arrays = {
        name: np.frombuffer(tensor["data"], "<f8").reshape(tensor["shape"])
        for name, tensor in sorted(deserialize(data))  # otherwise in a random order
    }
    return header, arrays, ()


def edit_container(value: Container, rng: Random) -> tuple[Container, str]:
    """Edit the header, an array, the set of arrays, or the bytes that are written at the end."""
    header, arrays, damage = value
    kind = rng.random()
    if kind < 0.45 or not arrays:
        edited, said = edit_tree(header, rng)
        return (edited, arrays, damage), f"header {said}"
    name = rng.choice(list(arrays))
    if kind < 0.85:
        array, said = edit_array(arrays[name], rng)
        return (header, {**arrays, name: array}, damage), f"{name}: {said}"
    if kind < 0.92:
        other = rng.choice(list(arrays))
        new = rng.choice(({k: v for k, v in arrays.items() if k != name}, {**arrays, name: arrays[other]}))
        new = rng.choice((new, {**arrays, f"{name}.x": arrays[other]}))
        return (header, new, damage), f"arrays {short_text(sorted(new), 200)}, {name} like {other}"
    seed = rng.getrandbits(32)
    return (header, arrays, (*damage, seed)), f"damage {seed}"


def container_writer(format_name: str) -> Callable[[Container], bytes]:
    """Return a function that writes a file of that kind, its checksum recomputed."""

    def write(value: Container) -> bytes:
        header, arrays, damage = value
        text = json_text(header)
        if isinstance(header, dict) and "content" in header:
            text = json_text({**header, "content": _content(format_name, header, text, arrays)})
        data = _safetensors(text, arrays)
        for seed in damage:
            data, _ = edit_bytes(data, Random(seed))
        return data

    return write


def _content(format_name: str, header: dict[str, Any], text: str, arrays: dict[str, Array]) -> str:
    if any(array.dtype.kind not in "fiub" for array in arrays.values()):
        return ""
    try:
        read = json.loads(text)
        del read["content"]
        return container_hash(format_name, read, arrays)
    except (ValueError, RecursionError, TypeError):  # it is refused before its hash is looked at
        return header["content"] if isinstance(header["content"], str) else ""


def _safetensors(text: str, arrays: dict[str, Array]) -> bytes:
    entries: dict[str, Any] = {"__metadata__": {METADATA_KEY: text}}
    parts: list[bytes] = []
    end = 0
    for name, array in arrays.items():
        dtype = NAMES.get(array.dtype.str[1:], "F64")
        part = array.astype(array.dtype.newbyteorder("<")).tobytes()
        entries[name] = {"dtype": dtype, "shape": list(array.shape), "data_offsets": [end, end + len(part)]}
        end += len(part)
        parts.append(part)
    head = json.dumps(entries).encode()
    head += b" " * (-len(head) % 8)
    return len(head).to_bytes(8, "little") + head + b"".join(parts)
