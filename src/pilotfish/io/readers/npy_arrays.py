"""Reader of NumPy arrays: NPY files with (T, D) or (N, T, D), and NPZ files with several arrays."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import Recording
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_tables import MAX_ARRAY_ENTRIES, MAX_NPZ_BYTES, ZIP_MAGIC, load_npz
from pilotfish.io.paths import is_file, open_regular_file, read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.io.readers.array_recordings import recordings_from_arrays
from pilotfish.io.readers.read_options import ReadOptions

FORMAT = "NumPy arrays (NPY, NPZ)"
NPY_MAGIC = b"\x93NUMPY"
SUFFIXES = {".npy", ".npz"}


def recognises(path: Path) -> bool:
    """Return whether a file is an NPY or NPZ file, by its first bytes and its suffix.

    Args:
        path: File.
    """
    if not is_file(path):
        return False
    if path.suffix.lower() in SUFFIXES:
        return True
    with open_regular_file(path, "a NumPy array") as file:
        return file.read(len(NPY_MAGIC)) == NPY_MAGIC


def read(path: Path, options: ReadOptions | None = None) -> Iterator[Recording]:
    """Read the recordings of an NPY or NPZ file.

    An array of named fields has its names as columns. The arrays of an NPZ file are signals of one recording
    or several recordings; see `array_recordings`.

    Args:
        path: File of at most 2^29 bytes and 2^26 numbers.
        options: Name and unit of the array of times.

    Yields:
        Each recording.

    Raises:
        InvalidInput: If the file is damaged, has Python objects, or arrays of other shapes.
    """
    chosen, file = options or ReadOptions(), str(path)
    data = read_file(path, "NumPy arrays", MAX_NPZ_BYTES)
    if data.startswith(ZIP_MAGIC):
        arrays = load_npz(data, file)
        if {"x", "A0", "b0"} <= set(arrays):
            raise InvalidInput(f"{file} is a table of a folder of demonstrations; read that folder instead")
    else:
        arrays = _load_npy(data, file)
    yield from recordings_from_arrays(arrays, path.stem, FORMAT, chosen, file)


def _load_npy(data: bytes, file: str) -> dict[str, np.ndarray]:
    try:
        _require_stated_size(data, file)
        loaded = np.load(io.BytesIO(data), allow_pickle=False)
    except InvalidInput:
        raise
    except READ_ERRORS as error:
        why = "it has Python objects, which are never loaded" if "pickle" in str(error) else error
        raise InvalidInput(
            f"{file}: not an array of numbers that can be read: {why}; write it with numpy.save, or lists of "
            "arrays with numpy.savez(path, *arrays)"
        ) from error
    if loaded.dtype.names:
        return _named_fields(loaded, file)
    if loaded.ndim not in (1, 2, 3):
        raise InvalidInput(f"{file} has shape {loaded.shape}, expected (T, D) or (N, T, D)")
    return {"x": loaded}


def _require_stated_size(data: bytes, file: str) -> None:
    """Check that the header states no more numbers than follow, before memory is reserved for them."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }.get(version)
    if read_header is None:
        raise InvalidInput(f"{file} has version {version} of the NPY format, expected 1.0 or 2.0")
    shape, _, dtype = read_header(stream)
    entries = 1
    for length in shape:
        entries *= length
    left = len(data) - stream.tell()
    if entries > MAX_ARRAY_ENTRIES or (not dtype.hasobject and entries * dtype.itemsize > left):
        raise InvalidInput(
            f"{file} states shape {shape}, but only {left} bytes follow, expected at most "
            f"{MAX_ARRAY_ENTRIES} numbers; the file may have been cut"
        )


def _named_fields(loaded: np.ndarray, file: str) -> dict[str, np.ndarray]:
    names = loaded.dtype.names or ()
    if loaded.ndim != 1 or any(loaded.dtype[name].shape or loaded.dtype[name].names for name in names):
        raise InvalidInput(
            f"{file} has nested fields or shape {loaded.shape}, expected rows of numbers with names"
        )
    return {name: loaded[name] for name in names}
