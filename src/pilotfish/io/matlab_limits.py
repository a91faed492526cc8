"""Limits of MATLAB files, checked before SciPy reads them.

A file of version 5 to 7.2 has a header of 128 bytes, then elements: a tag with type and length, 4 bytes each,
then the content. A compressed element contains one matrix, which may expand a thousandfold. SciPy reserves
memory for all items of a structure or cell array before it reads the first, so the stated sizes are compared
with the bytes present.

Source:
    MAT-File Format, The MathWorks, chapter 1.
"""

import zlib
from collections.abc import Iterator
from itertools import islice
from math import prod
from typing import Literal

from pilotfish.errors import InvalidInput

HEADER_BYTES = 128
TAG_BYTES = 8  # also the size of an empty element
MATRIX, COMPRESSED = 14, 15  # element types
ELEMENT_TYPES = {*range(1, 8), 9, *range(12, 19)}  # SciPy indexes a table with other types, and crashes
CELL, STRUCTURE, OBJECT = 1, 2, 3  # classes of matrices whose items are elements
MAX_DEPTH = 50  # of matrices within matrices
MAX_ELEMENTS = 1_000_000

Order = Literal["little", "big"]


def require_bounded_expansion(data: bytes, max_bytes: int) -> None:
    """Check that a MATLAB file needs no more memory than its content justifies.

    Files of version 4 have no compression and pass; SciPy refuses what is not a MATLAB file.

    Args:
        data: Content of the file.
        max_bytes: Largest size of all compressed elements after expansion.

    Raises:
        InvalidInput: If the file expands to more, or states more items or bytes than it has.
    """
    orders: dict[bytes, Order] = {b"IM": "little", b"MI": "big"}
    if (order := orders.get(data[126:HEADER_BYTES])) is None:
        return
    remaining = max_bytes
    for kind, content in _iter_elements(memoryview(data)[HEADER_BYTES:], order):
        matrices = [(kind, content)]
        if kind == COMPRESSED:
            unpacked = zlib.decompressobj().decompress(content, remaining + 1)
            if len(unpacked) > remaining:
                raise InvalidInput(f"it expands to more than {max_bytes} bytes; save it in parts")
            remaining -= len(unpacked)
            matrices = list(islice(_iter_elements(memoryview(unpacked), order), 1))
        for inner, matrix in matrices:
            if inner == MATRIX:
                _require_items_present(matrix, order)


def _iter_elements(data: memoryview, order: Order) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of consecutive elements."""
    offset = 0
    for _ in range(MAX_ELEMENTS):
        if offset + TAG_BYTES > len(data):
            return
        first = _read_integer(data, offset, order)
        kind = first & 0xFFFF
        if kind not in ELEMENT_TYPES:
            raise InvalidInput(f"an element has the unknown type {kind}")
        if small := first >> 16:  # up to four bytes, in the second half of the tag
            yield kind, data[offset + 4 : offset + 4 + small]
            offset += TAG_BYTES
            continue
        length, available = _read_integer(data, offset + 4, order), len(data) - offset - TAG_BYTES
        if length > available:  # SciPy would reserve memory for all of them
            raise InvalidInput(
                f"an element has a stated length of {length} bytes, but only {available} follow"
            )
        yield first, data[offset + TAG_BYTES : offset + TAG_BYTES + length]
        offset += TAG_BYTES + length + (0 if first == COMPRESSED else -length % 8)
    raise InvalidInput(f"it has more than {MAX_ELEMENTS} elements; save it in parts")


def _require_items_present(matrix: memoryview, order: Order, depth: int = 0) -> None:
    """Raise InvalidInput if a matrix states more items than it has bytes for."""
    if depth > MAX_DEPTH:
        raise InvalidInput(f"it has matrices nested more than {MAX_DEPTH} deep")
    elements = _iter_elements(matrix, order)
    first = list(islice(elements, 2))
    if len(first) < 2:
        return
    (_, flags), (_, sizes) = first
    kind = _read_integer(flags, 0, order) & 0xFF
    items = prod(_read_integer(sizes, offset, order) for offset in range(0, len(sizes) - 3, 4))
    if kind in (CELL, STRUCTURE, OBJECT) and items > len(matrix) // TAG_BYTES:
        raise InvalidInput(f"an array of {items} cells or structures has only {len(matrix)} bytes")
    for inner, content in elements:
        if inner == MATRIX:
            _require_items_present(content, order, depth + 1)


def _read_integer(data: memoryview, offset: int, order: Order) -> int:
    return int.from_bytes(data[offset : offset + 4], order)
