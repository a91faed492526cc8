"""Global heaps of HDF5 files, checked before h5py reads a text of variable length from them.

A heap has a head of 16 bytes (signature, version, size), then objects: an index of two bytes, six bytes that
do not matter here, a size of eight bytes, and the content, padded to a multiple of eight bytes. Index 0 is
free space, whose size includes its head. With a damaged size, the HDF5 library loops forever or reserves
gigabytes.

Source:
    HDF5 File Format Specification version 3.0, section III.E.
"""

import mmap
import os
from collections.abc import Iterator
from pathlib import Path

from pilotfish.errors import InvalidInput
from pilotfish.io.paths import open_regular_file

SIGNATURE = b"GCOL\x01\x00\x00\x00"  # with version 1
BLOCK = 2**24  # bytes that are searched at a time, whole pages
HEAD = 16  # bytes of the head of a heap, and of an object


def require_sound_heaps(path: Path) -> None:
    """Check that the objects of each global heap fill it without a gap.

    Args:
        path: HDF5 file; it is searched once from begin to end, without being loaded.

    Raises:
        InvalidInput: If a heap is damaged.
    """
    with open_regular_file(path, "an HDF5 file") as file:
        if not os.fstat(file.fileno()).st_size:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            for start in _find_heaps(data):
                if not _is_sound(data, start):
                    raise InvalidInput(
                        f"{path}: the heap of texts at byte {start} is damaged; fetch it again"
                    )


def _find_heaps(data: mmap.mmap) -> Iterator[int]:
    """Yield the places of heaps; blocks that were searched do not stay in memory."""
    for first in range(0, len(data), BLOCK):
        end = first + BLOCK + len(SIGNATURE) - 1
        start = data.find(SIGNATURE, first, end)
        while start >= 0:
            yield start
            start = data.find(SIGNATURE, start + len(SIGNATURE), end)
        if hasattr(mmap, "MADV_DONTNEED"):
            data.madvise(mmap.MADV_DONTNEED, first, min(BLOCK, len(data) - first))


def _is_sound(data: mmap.mmap, start: int) -> bool:
    end, position = start + _read_size(data, start + 8), start + HEAD
    if end > len(data):
        return False
    while position + HEAD <= end:
        index = int.from_bytes(data[position : position + 2], "little")
        size = _read_size(data, position + 8)
        needed = size if index == 0 else HEAD + size + -size % 8
        if needed < HEAD or position + needed > end:
            return False
        position += needed
    return True


def _read_size(data: mmap.mmap, position: int) -> int:
    return int.from_bytes(data[position : position + 8], "little")
