"""Rows of one demonstration as a CSV or NPZ file.

Both formats keep every number exactly. Reading is bounded: sizes are checked before anything is expanded, and
no pickled object is loaded.
"""

import csv
import io
import re
import zipfile
from array import array
from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.io.readers.column_headers import is_time_name, split_unit, to_seconds
from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.types import Array, Float
from pilotfish.validation import MAX_NAME_LENGTH, numeric_array, short_list, short_repr

ZIP_MAGIC = b"PK"  # first bytes of every NPZ file
MAX_CSV_BYTES = 2**27  # reading takes about ten times as much memory
MAX_NPZ_BYTES = 2**29  # of the file, and of its arrays after expansion
MAX_ARRAY_ENTRIES = 2**26  # numbers in all arrays of an NPZ file
MAX_ARRAYS = 1000
MAX_TIME_ERROR = 0.02  # of the period, of the time between two rows
RESAMPLE_FIX = "correct the period, or resample the recording with build_demonstration"
SUPPORTED_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # of numpy.savez and savez_compressed


def encode_csv(x: Float[Array, "T D"], names: Sequence[str]) -> bytes:
    """Return a CSV file: a header, and a line per row with the digits that restore each number exactly.

    Args:
        x: Rows.
        names: Name of each column.

    Raises:
        InvalidInput: If the file would be too large to be read again.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(x.tolist())
    return _require_writable_size(out.getvalue().encode(), MAX_CSV_BYTES)


def decode_csv(data: bytes, file: str, names: Sequence[str], period: float) -> Float[Array, "T D"]:
    """Return the rows of a CSV file; a first column of times is compared with the period and dropped.

    Args:
        data: Content of the file.
        file: Name of the file, for messages.
        names: Column names that the header must have. Units in brackets may follow them.
        period: Time between two rows that the manifest states [s].

    Raises:
        InvalidInput: If the header differs, a value is not a finite number, or the times contradict the
            period; the message names line and column.
    """
    try:
        lines = io.StringIO(data.decode("utf-8-sig"), newline="")
    except UnicodeDecodeError as error:
        raise InvalidInput(
            f"{file}: byte {error.start} is not UTF-8 text, expected UTF-8; save the file as UTF-8"
        ) from error
    reader = csv.reader(lines, strict=True)
    try:
        header = next(reader, [])
        columns = [*header[: len(header) - len(names)], *names] if _has_times(header, names) else [*names]
        _require_header(header[len(columns) - len(names) :], file, names)
        numbers = array("d")
        for row in reader:
            numbers.extend(_parse_row(row, f"{file}, line {reader.line_num}", columns))
    except csv.Error as error:
        raise InvalidInput(f"{file}, line {reader.line_num}: not CSV that can be read: {error}") from error
    rows = np.array(numbers, dtype=np.float64).reshape(-1, len(columns))
    if len(columns) > len(names):
        _require_times(rows[:, 0], columns[0], file, period)
    return rows[:, len(columns) - len(names) :]


def _has_times(header: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether a column of times precedes the columns of the layout."""
    return len(header) == len(names) + 1 and is_time_name(split_unit(header[0])[0])


def _require_times(values: Float[Array, " T"], column: str, file: str, period: float) -> None:
    """Refuse times that contradict the period."""
    if len(values) < 2:
        return
    label = f"{file}, column {short_repr(column)}"
    steps = np.diff(to_seconds(values, split_unit(column)[1], ReadOptions(), label))
    middle = float(np.median(steps))
    if np.abs(steps - period).max() > MAX_TIME_ERROR * period:
        raise InvalidInput(
            f"{label}: times ascend by {steps.min():.4g} to {steps.max():.4g} s per row (median "
            f"{middle:.4g}), but the manifest states a period of {period:.6g} s; {RESAMPLE_FIX}"
        )


def encode_npz(arrays: Mapping[str, Float[Array, "..."]]) -> bytes:
    """Return an NPZ file of the arrays.

    Args:
        arrays: Arrays by name.

    Raises:
        InvalidInput: If the file would be too large to be read again.
    """
    out = io.BytesIO()
    np.savez(out, **dict(arrays))  # type: ignore[arg-type] # the stub takes it for the flag allow_pickle
    return _require_writable_size(out.getvalue(), MAX_NPZ_BYTES)


def _require_writable_size(data: bytes, max_bytes: int) -> bytes:
    if len(data) > max_bytes:
        raise InvalidInput(f"the recording takes {len(data)} bytes, expected at most {max_bytes}; split it")
    return data


def decode_npz(data: bytes, file: str) -> dict[str, Float[Array, "..."]]:
    """Return the arrays of an NPZ file as float64.

    Args:
        data: Content of the file.
        file: Name of the file, for messages.

    Raises:
        InvalidInput: If the file is damaged, or holds anything but numbers.
    """
    if not data.startswith(ZIP_MAGIC):
        raise InvalidInput(f"{file}: not an NPZ file of numbers: no archive; write it with numpy.savez")
    loaded = load_npz(data, file)
    return {name: numeric_array(value, f"{file}: array {name!r}") for name, value in loaded.items()}


def load_npz(data: bytes, file: str) -> dict[str, np.ndarray]:
    """Return the arrays of an NPZ file without conversion; pickled objects are refused.

    The sizes that the archive states are checked first, and only that size is expanded.

    Args:
        data: Content of the file.
        file: Name of the file, for messages.

    Raises:
        InvalidInput: If the file is damaged, or has more than MAX_ARRAYS arrays, MAX_ARRAY_ENTRIES numbers or
            MAX_NPZ_BYTES bytes after expansion.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as listing:
            _require_size(listing.infolist())
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            loaded = {name: archive[name] for name in archive.files}
    except InvalidInput as error:
        raise InvalidInput(f"{file}: {error}") from error
    except READ_ERRORS as error:  # NumPy's message recommends to allow pickles; ours does not
        why = "it has Python objects, which are never loaded" if "pickle" in str(error) else error
        raise InvalidInput(f"{file}: not an NPZ file of numbers: {why}; write it with numpy.savez") from error
    if not_arrays := [name for name, value in loaded.items() if not isinstance(value, np.ndarray)]:
        raise InvalidInput(f"{file}: {short_repr(not_arrays[0])} is not an array; write it with numpy.savez")
    if (numbers := sum(value.size for value in loaded.values())) > MAX_ARRAY_ENTRIES:
        raise InvalidInput(f"{file} has {numbers} numbers, expected at most {MAX_ARRAY_ENTRIES}; split it")
    return loaded


def _require_size(members: Sequence[zipfile.ZipInfo]) -> None:
    if len(members) > MAX_ARRAYS:
        raise InvalidInput(f"it has {len(members)} arrays, expected at most {MAX_ARRAYS}")
    if (total := sum(member.file_size for member in members)) > MAX_NPZ_BYTES:
        raise InvalidInput(f"it expands to {total} bytes, expected at most {MAX_NPZ_BYTES}; split it")
    if unsupported := [
        member.filename for member in members if member.compress_type not in SUPPORTED_COMPRESSIONS
    ]:
        raise InvalidInput(
            f"array {short_repr(unsupported[0])} is compressed in an unsupported way; write it with "
            "numpy.savez"
        )
    if unprintable := [member.filename for member in members if not _is_printable(member.filename)]:
        raise InvalidInput(f"an array is named {short_repr(unprintable[0])}, expected a short printable name")


def _is_printable(name: str) -> bool:
    return name.isprintable() and len(name) <= MAX_NAME_LENGTH


def _require_header(header: Sequence[str], file: str, names: Sequence[str]) -> None:
    if [_without_unit(name) for name in header] == list(names) or list(header) == list(names):
        return
    if len(header) == 1 and ";" in header[0]:
        hint = "; columns are separated by commas, not semicolons"
    elif len(header) != len(names):
        hint = f": {len(header)} columns, expected {len(names)}"
    else:
        n = next(n for n, (a, b) in enumerate(zip(header, names, strict=True)) if a != b)
        hint = f": column {n + 1} is {short_repr(header[n])}, expected {names[n]!r}"
    raise InvalidInput(f"{file}, line 1: the header is not the layout's{hint}; expected {short_list(names)}")


def _without_unit(name: str) -> str:
    return re.sub(r"\s*\[[^\[\]]*\]$", "", name)


def _parse_row(row: Sequence[str], label: str, names: Sequence[str]) -> list[float]:
    if len(row) != len(names):
        raise InvalidInput(f"{label} has {len(row)} values, expected {len(names)}")
    return [_parse_number(value, label, name) for value, name in zip(row, names, strict=True)]


def _parse_number(value: str, label: str, name: str) -> float:
    try:
        number = float(value) if "_" not in value else None  # float accepts 1_0 as 10
    except ValueError:
        number = None
    if number is None:
        raise InvalidInput(f"{label}, column {name!r} is {short_repr(value)}, expected a number such as 0.25")
    if not isfinite(number):
        raise InvalidInput(
            f"{label}, column {name!r} is {short_repr(value)}, expected a finite number; remove that row or "
            "interpolate"
        )
    return number
