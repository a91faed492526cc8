"""Reader of MATLAB files up to version 7.2: matrices, stacked matrices, structures, and arrays of both."""

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Recording
from pilotfish.errors import InvalidInput
from pilotfish.io.matlab_limits import require_bounded_expansion
from pilotfish.io.paths import is_file, open_regular_file, read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.io.readers.array_recordings import is_pose_stack, recordings_from_arrays
from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.validation import short_list

FORMAT = "MATLAB (MAT)"
HDF5_MAGIC, HEADER = b"\x89HDF\r\n\x1a\n", b"MATLAB "
HDF5_OFFSETS = (0, 512)  # MATLAB writes its own text before the HDF5 file
MAX_MATLAB_BYTES = 2**26  # of the file, and after expansion; a number may take one byte
MAX_DEPTH = 5  # of structures within structures


def recognises(path: Path) -> bool:
    """Return whether a file is a MATLAB file, by its suffix or its first bytes.

    Args:
        path: File.
    """
    if not is_file(path):
        return False
    if path.suffix.lower() == ".mat":
        return True
    with open_regular_file(path, "a MATLAB file") as file:
        return file.read(len(HEADER)) == HEADER


def read(path: Path, options: ReadOptions | None = None) -> Iterator[Recording]:
    """Read the recordings of a MATLAB file.

    Variables are arrays as in `array_recordings`. A structure is one recording whose fields are signals, and
    an array of structures, or a cell array of matrices, is one recording for each. MATLAB users often have
    one sample per column: a matrix with more columns than rows is transposed, and the format of the
    recording says this. Poses of shape (4, 4, T) are rows.

    Args:
        path: File of at most 2^26 bytes, also after expansion.
        options: Name and unit of the array of times.

    Yields:
        Each recording.

    Raises:
        InvalidInput: If the file is damaged, of version 7.3, or has no arrays of these kinds.
    """
    chosen, file = options or ReadOptions(), str(path)
    variables = _load(read_file(path, "a MATLAB file", MAX_MATLAB_BYTES), file)
    lists = {key: value for key, value in variables.items() if _is_list(value)}
    for key, members in lists.items():
        for n, member in enumerate(members):
            yield from _read_structure({key: member}, f"{path.stem} {key} {n + 1}", chosen, file)
    rest = {key: value for key, value in variables.items() if key not in lists}
    structures = {key: value for key, value in rest.items() if _has_rows(value)}
    for key, fields in structures.items():
        yield from _read_structure(fields, f"{path.stem} {key}", chosen, file)
    arrays = {key: value for key, value in rest.items() if key not in structures}
    if not lists and not structures:
        yield from _read_structure(arrays, path.stem, chosen, file, numbered=True)


def _read_structure(
    fields: Mapping[str, Any], name: str, options: ReadOptions, file: str, numbered: bool = False
) -> Iterator[Recording]:
    arrays = dict(_flatten(fields, ""))
    tall = {key: _samples_in_rows(array) for key, array in arrays.items()}
    transposed = any(tall[key] is not array for key, array in arrays.items())
    name_of_format = f"{FORMAT}, transposed" if transposed else FORMAT
    yield from recordings_from_arrays(tall, name, name_of_format, options, file, numbered=numbered)


def _has_rows(value: object) -> bool:
    """Return whether a variable is a structure with a vector or matrix of numbers, not of settings only."""
    arrays = dict(_flatten(value, "")) if isinstance(value, dict) else {}
    return any(array.size > 1 and array.dtype.kind in "fiub" for array in arrays.values())


def _samples_in_rows(array: np.ndarray) -> np.ndarray:
    """Return matrices transposed if they are wide, poses (4, 4, T) as (T, 4, 4), and others unchanged."""
    if array.ndim == 3 and array.shape[:2] == (4, 4) and is_pose_stack(np.moveaxis(array, 2, 0)):
        return np.moveaxis(array, 2, 0)
    if array.dtype.kind in "fiub" and array.ndim == 2 and 1 < array.shape[0] < array.shape[1]:
        return array.T
    return array


def _flatten(fields: Mapping[str, Any], prefix: str, depth: int = 0) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of structures within structures, with their names joined by points."""
    for key, value in fields.items():
        name = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, Mapping):
            if depth < MAX_DEPTH:
                inner = "" if len(fields) == 1 and depth == 0 else name
                yield from _flatten(value, inner, depth + 1)
            continue
        array = _text_array(value) if _is_text_list(value) else np.asarray(value)
        if array.dtype.kind in "fiubU" and array.ndim <= 3:
            yield name, array


def _is_list(value: object) -> bool:
    """Return whether a variable is an array of structures or a cell array of matrices."""
    is_cell = isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim == 1
    members = list(value) if isinstance(value, list) or is_cell else []  # type: ignore[call-overload]
    kinds = (dict, np.ndarray)
    return bool(members) and all(isinstance(m, kinds) and not _is_text_list(m) for m in members)


def _is_text_list(value: object) -> bool:
    """Return whether a value is a cell array of texts, or a matrix of characters."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":
        return value.ndim == 1 and all(isinstance(entry, str) for entry in value)
    return isinstance(value, list) and bool(value) and all(isinstance(entry, str) for entry in value)


def _text_array(value: Any) -> np.ndarray:
    return np.array([str(entry) for entry in value])


def _load(data: bytes, file: str) -> dict[str, Any]:
    from scipy.io import loadmat  # slow to import
    from scipy.io.matlab import MatReadError

    is_hdf5 = any(data[offset : offset + len(HDF5_MAGIC)] == HDF5_MAGIC for offset in HDF5_OFFSETS)
    if is_hdf5 or data.startswith(b"MATLAB 7.3"):
        raise InvalidInput(
            f"{file} is a MATLAB file of version 7.3, which is HDF5, expected version 7 or earlier; save it "
            "with save(file, '-v7')"
        )
    try:
        require_bounded_expansion(data, MAX_MATLAB_BYTES)
        loaded: dict[str, Any] = loadmat(io.BytesIO(data), simplify_cells=True)
    except InvalidInput as error:
        raise InvalidInput(f"{file}: {error}") from error
    except (*READ_ERRORS, MatReadError) as error:
        raise InvalidInput(f"{file}: not a MATLAB file that can be read: {error}") from error
    variables = {key: value for key, value in loaded.items() if not key.startswith("__")}
    if not variables:
        raise InvalidInput(f"{file} has no variables, expected matrices; it has {short_list(list(loaded))}")
    return variables
