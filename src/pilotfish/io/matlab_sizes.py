"""What a MATLAB file expands to, looked at before SciPy reads it.

A file of version 5 to 7.2 has a header of 128 bytes, then elements: a tag of a kind and a length, 4 bytes
each, and as many bytes. A compressed element holds one matrix, which may expand a thousandfold. SciPy
reserves memory for all items of a structure or cell array before it reads the first; so the sizes that
matrices give are compared with the bytes that are there.
Source: MAT-File Format, The MathWorks, chapter 1.
"""

import zlib
from collections.abc import Iterator
from itertools import islice
from math import prod
from typing import Literal

from pilotfish.errors import InvalidInput

HEADER_BYTES = 128  # bytes
TAG_BYTES = 8  # bytes of a tag, and of the tag of an empty element
MATRIX, COMPRESSED = 14, 15  # kinds of elements
ELEMENT_TYPES = {
    *range(1, 8),
    9,
    *range(12, 19),
}  # SciPy looks others up beyond the end of a table, and crashes
CELL, STRUCTURE, OBJECT = 1, 2, 3  # classes of matrices whose items are elements of their own
MAX_DEPTH = 50  # matrices in matrices
MAX_ELEMENTS = 1_000_000

Order = Literal["little", "big"]


def require_bounded_expansion(data: bytes, max_bytes: int) -> None:
    """Raise InvalidInput if a MATLAB file would take more memory than its content explains.

    Files of version 4 have no compression; what is no MATLAB file at all is left to SciPy to refuse.

    Args:
        data: The bytes of the file.
        largest: Largest number of bytes that all compressed elements together may expand to.
    """
    orders: dict[bytes, Order] = {b"IM": "little", b"MI": "big"}
    if (order := orders.get(data[126:HEADER_BYTES])) is None:
        return
    remaining = max_bytes
    for kind, content in _elements(memoryview(data)[HEADER_BYTES:], order):
        matrices = [(kind, content)]
        if kind == COMPRESSED:
            unpacked = zlib.decompressobj().decompress(content, remaining + 1)
            if len(unpacked) > remaining:
                raise InvalidInput(f"it expands to more than {max_bytes} bytes, expected at most that")
            remaining -= len(unpacked)
            matrices = list(islice(_elements(memoryview(unpacked), order), 1))
        for inner, matrix in matrices:
            if inner == MATRIX:
                _require_items_present(matrix, order)


def _elements(data: memoryview, order: Order) -> Iterator[tuple[int, memoryview]]:
    """Yield kind and content of the elements that follow one another."""
    offset = 0
    for _ in range(MAX_ELEMENTS):
        if offset + TAG_BYTES > len(data):
            return
        first = _number(data, offset, order)
        kind = first & 0xFFFF
        if kind not in ELEMENT_TYPES:
            raise InvalidInput(f"an element is of the unknown kind {kind}")
        if small := first >> 16:  # up to four bytes, in the second half of the tag
            yield kind, data[offset + 4 : offset + 4 + small]
            offset += TAG_BYTES
            continue
        length, available = _number(data, offset + 4, order), len(data) - offset - TAG_BYTES
        if length > available:  # SciPy reserves memory for all of them
            raise InvalidInput(f"an element says that it has {length} bytes, but only {available} follow")
        yield first, data[offset + TAG_BYTES : offset + TAG_BYTES + length]
        offset += TAG_BYTES + length + (0 if first == COMPRESSED else -length % 8)
    raise InvalidInput(f"it has more than {MAX_ELEMENTS} elements, expected at most that")


def _require_items_present(matrix: memoryview, order: Order, depth: int = 0) -> None:
    """Raise InvalidInput if a matrix says that it has more items than it has bytes for."""
    if depth > MAX_DEPTH:
        raise InvalidInput(f"it has matrices within matrices, more than {MAX_DEPTH} deep")
    elements = _elements(matrix, order)
    first = list(islice(elements, 2))
    if len(first) < 2:
        return
    (_, flags), (_, sizes) = first
    kind = _number(flags, 0, order) & 0xFF
    items = prod(_number(sizes, offset, order) for offset in range(0, len(sizes) - 3, 4))
    if kind in (CELL, STRUCTURE, OBJECT) and items > len(matrix) // TAG_BYTES:
        raise InvalidInput(f"an array of {items} cells or structures has only {len(matrix)} bytes")
    for inner, content in elements:
        if inner == MATRIX:
            _require_items_present(content, order, depth + 1)


def _number(data: memoryview, offset: int, order: Order) -> int:
    return int.from_bytes(data[offset : offset + 4], order)
