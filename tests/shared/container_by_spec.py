"""Independent implementation of skill and stream files, written from their pages in docs/."""

import hashlib
import json
from typing import Any

import numpy as np
from safetensors.numpy import save

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]


def split_container(data: bytes) -> tuple[Header, Arrays]:
    """Return the header and the arrays of a file."""
    length = int.from_bytes(data[:8], "little")
    table = json.loads(data[8 : 8 + length])
    header, body = json.loads(table.pop("__metadata__")["pilotfish"]), data[8 + length :]
    arrays = {
        name: np.frombuffer(body[slice(*entry["data_offsets"])], "<f8").reshape(entry["shape"]).copy()
        for name, entry in table.items()
    }
    return header, arrays


def canonical_json(value: object) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode()


def documented_hash(header: Header, arrays: Arrays) -> str:
    content = {key: value for key, value in header.items() if key != "content"}
    text = canonical_json(content)
    for name in sorted(arrays):
        text += canonical_json([name, "F64", list(arrays[name].shape)]) + arrays[name].astype("<f8").tobytes()
    return hashlib.sha256(text).hexdigest()


def with_hash(header: Header, arrays: Arrays) -> bytes:
    """Return a file of these contents with a valid hash."""
    header = header | {"content": documented_hash(header, arrays)}
    return bytes(save(arrays, {"pilotfish": json.dumps(header)}))
