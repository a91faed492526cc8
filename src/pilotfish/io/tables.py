"""The rows of one demonstration as a CSV or NPZ file."""

import csv
import io
import zipfile
from array import array
from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.types import Array, Float
from pilotfish.validation import MAX_NAME_LENGTH, numeric_array, short_list, short_repr

ZIP_MAGIC = b"PK"  # how every NPZ file begins
MAX_CSV_BYTES = 2**27  # bytes of a CSV file; reading it takes some ten times as much memory
MAX_NPZ_BYTES = 2**29  # bytes of an NPZ file, and of what it holds once it is expanded
MAX_ARRAY_ENTRIES = 2**26  # in all arrays of an NPZ file
MAX_ARRAYS = 1000
SUPPORTED_COMPRESSIONS = (
    zipfile.ZIP_STORED,
    zipfile.ZIP_DEFLATED,
)  # as numpy.savez and savez_compressed write


def encode_csv(x: Float[Array, "T D"], names: Sequence[str]) -> bytes:
    """A header and a line for each row; every number with the digits it takes to read it back equal."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(x.tolist())
    return _require_writable_size(out.getvalue().encode(), MAX_CSV_BYTES)


def decode_csv(data: bytes, file: str, names: Sequence[str]) -> Float[Array, "T D"]:
    """The numbers below the header, which must hold these names.

    Raises: InvalidInput, naming the line and the column.
    """
    try:
        lines = io.StringIO(data.decode("utf-8-sig"), newline="")
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{file}: byte {error.start} is no UTF-8 text; save the file as UTF-8") from error
    reader = csv.reader(lines, strict=True)
    try:
        _require_header(next(reader, []), file, names)
        numbers = array("d")
        for row in reader:
            numbers.extend(_numbers(row, f"{file}, line {reader.line_num}", names))
    except csv.Error as error:
        raise InvalidInput(f"{file}, line {reader.line_num}: not CSV that can be read: {error}") from error
    return np.array(numbers, dtype=np.float64).reshape(-1, len(names))


def encode_npz(arrays: Mapping[str, Float[Array, "..."]]) -> bytes:
    out = io.BytesIO()
    np.savez(out, **dict(arrays))  # type: ignore[arg-type] # the stub takes a mapping for its flag allow_pickle
    return _require_writable_size(out.getvalue(), MAX_NPZ_BYTES)


def _require_writable_size(data: bytes, max_bytes: int) -> bytes:
    """Return the bytes of a file if it can be read again."""
    if len(data) > max_bytes:
        raise InvalidInput(
            f"the recording takes {len(data)} bytes, expected at most {max_bytes}; cut it in parts"
        )
    return data


def decode_npz(data: bytes, file: str) -> dict[str, Float[Array, "..."]]:
    """Every array in the archive; nothing in it is executed (no pickles).

    Raises: InvalidInput, when it is damaged or holds other than numbers.
    """
    if not data.startswith(ZIP_MAGIC):
        raise InvalidInput(
            f"{file}: not an NPZ file of numbers that can be read: no archive; write it with numpy.savez"
        )
    loaded = load_npz(data, file)
    return {name: numeric_array(value, f"{file}: array {name!r}") for name, value in loaded.items()}


def load_npz(data: bytes, file: str) -> dict[str, np.ndarray]:
    """Return the arrays of an NPZ file by name; nothing in it is executed (no pickles).

    What the archive promises to expand to is looked at first, and no more than that is expanded.

    Args:
        data: The bytes of the file.
        file: Its name, for messages.

    Raises:
        InvalidInput: If it is damaged, or holds or expands to more than LARGEST_ARCHIVE bytes, MOST_NUMBERS
            numbers or MOST_ARRAYS arrays.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as listing:
            _require_size(listing.infolist())
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            loaded = {name: archive[name] for name in archive.files}
    except InvalidInput as error:
        raise InvalidInput(f"{file}: {error}") from error
    except READ_ERRORS as error:  # NumPy advises to load pickles all the same; we do not
        why = "it holds Python objects, which are never loaded" if "pickle" in str(error) else error
        raise InvalidInput(f"{file}: not an NPZ file of numbers that can be read: {why}") from error
    if other := [name for name, value in loaded.items() if not isinstance(value, np.ndarray)]:
        raise InvalidInput(f"{file}: {short_repr(other[0])} is not an array; write it with numpy.savez")
    if (numbers := sum(value.size for value in loaded.values())) > MAX_ARRAY_ENTRIES:
        raise InvalidInput(
            f"{file} has {numbers} numbers, expected at most {MAX_ARRAY_ENTRIES}; cut it in parts"
        )
    return loaded


def _require_size(members: Sequence[zipfile.ZipInfo]) -> None:
    if len(members) > MAX_ARRAYS:
        raise InvalidInput(f"it has {len(members)} arrays, expected at most {MAX_ARRAYS}")
    if (total := sum(member.file_size for member in members)) > MAX_NPZ_BYTES:
        raise InvalidInput(f"it expands to {total} bytes, expected at most {MAX_NPZ_BYTES}; cut it in parts")
    if odd := [member.filename for member in members if member.compress_type not in SUPPORTED_COMPRESSIONS]:
        raise InvalidInput(
            f"array {short_repr(odd[0])} is packed in an unusual way; write it with numpy.savez"
        )
    if odd := [member.filename for member in members if not _printable(member.filename)]:
        raise InvalidInput(f"an array is named {short_repr(odd[0])}, expected a short printable name")


def _printable(name: str) -> bool:
    return name.isprintable() and len(name) <= MAX_NAME_LENGTH


def _require_header(header: Sequence[str], file: str, names: Sequence[str]) -> None:
    if list(header) == list(names):
        return
    if len(header) == 1 and ";" in header[0]:
        hint = "; columns are separated by commas, not semicolons"
    elif len(header) != len(names):
        hint = f": {len(header)} columns, expected {len(names)}"
    else:
        n = next(n for n, (a, b) in enumerate(zip(header, names, strict=True)) if a != b)
        hint = f": column {n + 1} is {short_repr(header[n])}, expected {names[n]!r}"
    raise InvalidInput(
        f"{file}, line 1: the header is not the layout's{hint}; it should be {short_list(names)}"
    )


def _numbers(row: Sequence[str], label: str, names: Sequence[str]) -> list[float]:
    if len(row) != len(names):
        raise InvalidInput(f"{label} has {len(row)} values, expected {len(names)}")
    return [_number(value, label, name) for value, name in zip(row, names, strict=True)]


def _number(value: str, label: str, name: str) -> float:
    try:
        read = float(value) if "_" not in value else None  # float takes 1_0 for 10
    except ValueError:
        read = None
    if read is None:
        raise InvalidInput(f"{label}, column {name!r} is {short_repr(value)}, expected a number such as 0.25")
    if not isfinite(read):
        raise InvalidInput(
            f"{label}, column {name!r} is {short_repr(value)}, expected a finite number; cut that row or "
            "fill the gap"
        )
    return read
