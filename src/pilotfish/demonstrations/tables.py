"""The rows of one demonstration as a CSV or NPZ file."""

import csv
import io
from collections.abc import Mapping, Sequence
from math import isfinite

import numpy as np

from pilotfish.demonstrations.damage import DAMAGED
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array

ARCHIVE = b"PK"  # how every NPZ file begins


def csv_bytes(x: Float[Array, "T D"], names: Sequence[str]) -> bytes:
    """A header and a line for each row; every number with the digits it takes to read it back equal."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(x.tolist())
    return out.getvalue().encode()


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
        rows = [_numbers(row, f"{file}, line {reader.line_num}", names) for row in reader]
    except csv.Error as error:
        raise InvalidInput(f"{file}, line {reader.line_num}: not CSV that can be read: {error}") from error
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(names))


def npz_bytes(arrays: Mapping[str, Float[Array, "..."]]) -> bytes:
    out = io.BytesIO()
    np.savez(out, **dict(arrays))  # type: ignore[arg-type] # the stub takes a mapping for its flag allow_pickle
    return out.getvalue()


def arrays_of_npz(data: bytes, file: str) -> dict[str, Float[Array, "..."]]:
    """Every array in the archive; nothing in it is executed (no pickles).

    Raises: InvalidInput, when it is damaged or holds other than numbers.
    """
    if not data.startswith(ARCHIVE):
        raise InvalidInput(
            f"{file}: not an NPZ file of numbers that can be read: no archive; write it with numpy.savez"
        )
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            loaded = {name: archive[name] for name in archive.files}
    except DAMAGED as error:  # NumPy advises to load pickles all the same; we do not
        why = "it holds Python objects, which are never loaded" if "pickle" in str(error) else error
        raise InvalidInput(f"{file}: not an NPZ file of numbers that can be read: {why}") from error
    return {name: numeric_array(value, f"{file}: array {name!r}") for name, value in loaded.items()}


def _refuse_header(header: Sequence[str], file: str, names: Sequence[str]) -> None:
    if list(header) == list(names):
        return
    if len(header) == 1 and ";" in header[0]:
        hint = "; columns are separated by commas, not semicolons"
    elif len(header) != len(names):
        hint = f": {len(header)} columns, expected {len(names)}"
    else:
        n = next(n for n, (a, b) in enumerate(zip(header, names, strict=True)) if a != b)
        hint = f": column {n + 1} is {header[n]!r}, expected {names[n]!r}"
    raise InvalidInput(
        f"{file}, line 1: the header is not the layout's{hint}; it should be {','.join(names)}"
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
        raise InvalidInput(f"{place}, column {name!r} is {value!r}, expected a number such as 0.25")
    if not isfinite(read):
        raise InvalidInput(
            f"{place}, column {name!r} is {value}, expected a finite number; cut that row or fill the gap"
        )
    return read
