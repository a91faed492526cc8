"""The rows of one demonstration as a CSV or NPZ file."""

import csv
import io
import zipfile
from array import array
from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np

from pilotfish.demonstrations.damage import DAMAGED
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import LONGEST_NAME, numeric_array, short_list, short_repr

ARCHIVE = b"PK"  # how every NPZ file begins
LARGEST_TABLE = 2**27  # bytes of a CSV file; reading it takes some ten times as much memory
LARGEST_ARCHIVE = 2**29  # bytes of an NPZ file, and of what it holds once it is expanded
MOST_NUMBERS = 2**26  # in all arrays of an NPZ file
MOST_ARRAYS = 1000
PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # as numpy.savez and savez_compressed write


def csv_bytes(x: Float[Array, "T D"], names: Sequence[str]) -> bytes:
    """A header and a line for each row; every number with the digits it takes to read it back equal."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(x.tolist())
    return _bounded(out.getvalue().encode(), LARGEST_TABLE)


def rows_of_csv(data: bytes, file: str, names: Sequence[str]) -> Float[Array, "T D"]:
    """The numbers below the header, which must hold these names.

    Raises: InvalidInput, naming the line and the column.
    """
    try:
        lines = io.StringIO(data.decode("utf-8-sig"), newline="")
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{file}: byte {error.start} is no UTF-8 text; save the file as UTF-8") from error
    reader = csv.reader(lines, strict=True)
    try:
        _refuse_header(next(reader, []), file, names)
        numbers = array("d")
        for row in reader:
            numbers.extend(_numbers(row, f"{file}, line {reader.line_num}", names))
    except csv.Error as error:
        raise InvalidInput(f"{file}, line {reader.line_num}: not CSV that can be read: {error}") from error
    return np.array(numbers, dtype=np.float64).reshape(-1, len(names))


def npz_bytes(arrays: Mapping[str, Float[Array, "..."]]) -> bytes:
    out = io.BytesIO()
    np.savez(out, **dict(arrays))  # type: ignore[arg-type] # the stub takes a mapping for its flag allow_pickle
    return _bounded(out.getvalue(), LARGEST_ARCHIVE)


def _bounded(data: bytes, largest: int) -> bytes:
    """Return the bytes of a file if it can be read again."""
    if len(data) > largest:
        raise InvalidInput(
            f"the recording takes {len(data)} bytes, expected at most {largest}; cut it in parts"
        )
    return data


def arrays_of_npz(data: bytes, file: str) -> dict[str, Float[Array, "..."]]:
    """Every array in the archive; nothing in it is executed (no pickles).

    Raises: InvalidInput, when it is damaged or holds other than numbers.
    """
    if not data.startswith(ARCHIVE):
        raise InvalidInput(
            f"{file}: not an NPZ file of numbers that can be read: no archive; write it with numpy.savez"
        )
    loaded = load_archive(data, file)
    return {name: numeric_array(value, f"{file}: array {name!r}") for name, value in loaded.items()}


def load_archive(data: bytes, file: str) -> dict[str, np.ndarray]:
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
            _refuse_large(listing.infolist())
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            loaded = {name: archive[name] for name in archive.files}
    except InvalidInput as error:
        raise InvalidInput(f"{file}: {error}") from error
    except DAMAGED as error:  # NumPy advises to load pickles all the same; we do not
        why = "it holds Python objects, which are never loaded" if "pickle" in str(error) else error
        raise InvalidInput(f"{file}: not an NPZ file of numbers that can be read: {why}") from error
    if other := [name for name, value in loaded.items() if not isinstance(value, np.ndarray)]:
        raise InvalidInput(f"{file}: {short_repr(other[0])} is not an array; write it with numpy.savez")
    if (numbers := sum(value.size for value in loaded.values())) > MOST_NUMBERS:
        raise InvalidInput(f"{file} has {numbers} numbers, expected at most {MOST_NUMBERS}; cut it in parts")
    return loaded


def _refuse_large(members: Sequence[zipfile.ZipInfo]) -> None:
    if len(members) > MOST_ARRAYS:
        raise InvalidInput(f"it has {len(members)} arrays, expected at most {MOST_ARRAYS}")
    if (total := sum(member.file_size for member in members)) > LARGEST_ARCHIVE:
        raise InvalidInput(
            f"it expands to {total} bytes, expected at most {LARGEST_ARCHIVE}; cut it in parts"
        )
    if odd := [member.filename for member in members if member.compress_type not in PACKED]:
        raise InvalidInput(
            f"array {short_repr(odd[0])} is packed in an unusual way; write it with numpy.savez"
        )
    if odd := [member.filename for member in members if not _printable(member.filename)]:
        raise InvalidInput(f"an array is named {short_repr(odd[0])}, expected a short printable name")


def _printable(name: str) -> bool:
    return name.isprintable() and len(name) <= LONGEST_NAME


def _refuse_header(header: Sequence[str], file: str, names: Sequence[str]) -> None:
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


def _numbers(row: Sequence[str], place: str, names: Sequence[str]) -> list[float]:
    if len(row) != len(names):
        raise InvalidInput(f"{place} has {len(row)} values, expected {len(names)}")
    return [_number(value, place, name) for value, name in zip(row, names, strict=True)]


def _number(value: str, place: str, name: str) -> float:
    try:
        read = float(value) if "_" not in value else None  # float takes 1_0 for 10
    except ValueError:
        read = None
    if read is None:
        raise InvalidInput(f"{place}, column {name!r} is {short_repr(value)}, expected a number such as 0.25")
    if not isfinite(read):
        raise InvalidInput(
            f"{place}, column {name!r} is {short_repr(value)}, expected a finite number; cut that row or "
            "fill the gap"
        )
    return read
