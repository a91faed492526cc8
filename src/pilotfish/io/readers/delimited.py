"""Reader of tables of text: CSV, TSV, and columns separated by semicolons or blanks.

The header, units, comments, separator and column of times are recognised. Text in UTF-8 or UTF-16 with a byte
order mark is read. Cells without a number are NaN; columns of text are labels.
"""

import csv
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import Recording, Signal, is_unit
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_tables import MAX_CSV_BYTES
from pilotfish.io.paths import is_file, open_regular_file, read_file
from pilotfish.io.readers.column_headers import find_time_column, seconds_pair, split_unit, to_seconds
from pilotfish.io.readers.read_options import SEPARATORS, ReadOptions
from pilotfish.types import Array, Float
from pilotfish.validation import require_printable, short_list, short_repr

FORMAT = "CSV, TSV or text columns"
SUFFIXES = {".csv", ".tsv", ".txt", ".dat", ".tab", ".log", ".asc"}
COMMENTS = ("#", "%", "//")
MAX_COLUMNS = 10_000
SAMPLE_LINES = 20  # from which the separator is recognised
PROBE_BYTES = 4096
MOTIVE_UNITS = {"Millimeters": "mm", "Centimeters": "cm", "Meters": "m"}
TRUTH = {"true": 1.0, "false": 0.0}
_DECIMAL_COMMA = re.compile(r"[+-]?(\d*|\d{1,3}(\.\d{3})+),\d+([eE][+-]?\d+)?")
Line = tuple[int, str]  # its number in the file, from 1, and its text


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Cells of a file: names and units of the columns, numbers, and texts by column."""

    names: list[str]
    units: list[str]
    numbers: Float[Array, "T D"]
    texts: dict[int, list[str]]


def recognises(path: Path) -> bool:
    """Return whether a file is a table by its suffix, or by its first line if it has none.

    Args:
        path: File.
    """
    if not is_file(path):
        return False
    if path.suffix:
        return path.suffix.lower() in SUFFIXES
    with open_regular_file(path, "a table") as file:
        start = file.read(PROBE_BYTES)
    words = re.split(rb"[\s,;]+", start.strip().split(b"\n")[0].strip())
    return b"\0" not in start and all(_is_number(word.decode("latin-1")) for word in words)


def read(path: Path, options: ReadOptions | None = None) -> Iterator[Recording]:
    """Read the one recording of a table.

    Args:
        path: File of at most 2^27 bytes.
        options: Separator, name and unit of the column of times.

    Yields:
        The recording.

    Raises:
        InvalidInput: If the file is not text, has no rows, rows of different lengths or decimal commas; the
            message names the line.
    """
    chosen, file = options or ReadOptions(), str(path)
    lines, comments, stated = _split_lines(_decode(read_file(path, "a table", MAX_CSV_BYTES), file))
    if not lines:
        raise InvalidInput(f"{file} has no rows, expected a header and a row of numbers per sample")
    lines = _join_motive_header(lines, file)
    separator = SEPARATORS.get(chosen.separator) or stated or _find_separator(lines)
    table = _parse_table(_iter_rows(lines, separator, file), comments, separator, file)
    yield _to_recording(table, chosen, path)


def _decode(data: bytes, file: str) -> str:
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise InvalidInput(
            f"{file}: byte {error.start} is not UTF-8 text, expected a table of text; save it as CSV in UTF-8"
        ) from error
    if "\0" in text:
        raise InvalidInput(f"{file} contains binary data, expected a table of text; save it as CSV in UTF-8")
    return text


def _split_lines(text: str) -> tuple[list[Line], list[str], str]:
    """Return lines with content, comments before the first of them, and a separator that `sep=` states."""
    lines: list[Line] = []
    comments: list[str] = []
    separator = ""
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        stripped = line.strip()
        if not stripped:
            continue
        if not lines and re.fullmatch(r"sep=.", stripped):
            separator = stripped[-1]
        elif stripped.startswith(COMMENTS):
            comments += [] if lines else [stripped.lstrip("#%/ ")]
        else:
            lines.append((number, line))
    return lines, comments, separator


def _join_motive_header(lines: list[Line], file: str) -> list[Line]:
    """Return lines with one header if they are an export of Motive, which has rows of names above it."""
    start = next((n for n, (_, line) in enumerate(lines[:20]) if line.lower().startswith("frame,time")), 0)
    if not start or not lines[0][1].startswith("Format Version,"):
        return lines
    rows = [cells for _, cells in _iter_rows(lines[: start + 1], ",", file)]
    owners = next((row for row in rows if _cell(row, 1) == "Name"), [])
    unit = next((unit for word, unit in MOTIVE_UNITS.items() if word in rows[0]), "")
    names = rows[-1][:2]
    for n in range(2, len(rows[-1])):
        kind = _cell(rows[-2], n)
        words = " ".join(word for word in (_cell(owners, n), kind, rows[-1][n]) if word).replace(",", " ")
        names.append(f"{words} [{unit}]" if unit and kind == "Position" else words)
    header = ",".join(name.replace('"', " ") for name in names)
    return [(lines[start][0], header), *lines[start + 1 :]]


def _find_separator(lines: Sequence[Line]) -> str:
    """Return the separator of the last lines of a sample, where headers with blanks are unlikely."""
    sample = [line for _, line in lines[:SAMPLE_LINES]][-max(1, SAMPLE_LINES // 2) :]
    for separator in (";", "\t", ","):
        cells = [line.strip().split(separator) for line in sample]
        if separator == "," and any(len(line.split()) > 1 for line in sample):
            # "0,1 0,2" is two numbers with decimal commas; "0.1, 0.2" has a separator before each blank
            words = [word for line in sample for word in line.split()]
            if all(_DECIMAL_COMMA.fullmatch(word) for word in words):
                return " "
        if sum(len(row) > 1 for row in cells) > len(cells) / 2:  # the last line may be cut
            return separator
    return " "


def _iter_rows(lines: Sequence[Line], separator: str, file: str) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line, without blanks around cells."""
    for number, line in lines:
        try:
            if separator == " ":
                cells = line.split()
            else:
                cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True))
        except csv.Error as error:
            raise InvalidInput(f"{file}, line {number}: not a row that can be read: {error}") from error
        if len(cells) > MAX_COLUMNS:
            raise InvalidInput(
                f"{file}, line {number} has {len(cells)} cells, expected at most {MAX_COLUMNS}; check the "
                "separator"
            )
        yield number, [cell.strip() for cell in cells]


def _parse_table(
    rows: Iterator[tuple[int, list[str]]], comments: Sequence[str], separator: str, file: str
) -> _Table:
    first_number, first = next(rows)
    following = next(rows, None)
    header: list[str] = []
    units: list[str] = []
    body = [(first_number, first)] + ([following] if following else [])
    if _is_header(first, following[1] if following else None):
        header, body = first, body[1:]
        if following and _is_unit_row(following[1]):
            units, body = [cell.strip("[]() ") for cell in following[1]], []
    elif comments:
        cells = next(_iter_rows([(1, comments[-1])], separator, file))[1]
        header = cells if len(cells) == len(first) and not any(map(_is_number, cells)) else []
    return _parse_rows(header, units, body, rows, file)


def _is_header(first: Sequence[str], second: Sequence[str] | None) -> bool:
    if second is not None and first == ["", *map(str, range(len(first) - 1))] and second[0]:
        return True  # pandas leaves the name of the index empty, and numbers other columns
    return not any(map(_is_number, first))


def _is_unit_row(cells: Sequence[str]) -> bool:
    texts = [cell.strip("[]() ") for cell in cells]
    return any(texts) and all(is_unit(text) and not _is_number(text) for text in texts)


def _parse_rows(
    header: list[str],
    units: list[str],
    body: Sequence[tuple[int, list[str]]],
    rows: Iterator[tuple[int, list[str]]],
    file: str,
) -> _Table:
    start = body[0] if body else next(rows, None)
    if start is None:
        raise InvalidInput(f"{file} has a header but no rows, expected a row of numbers per sample")
    width = len(header) or len(start[1])
    while width > 1 and not _cell(header, width - 1) and not _cell(start[1], width - 1):
        width -= 1  # a separator at the end of each line
    names = header[:width] or [f"column {n + 1}" for n in range(width)]
    names = [name or f"column {n + 1}" for n, name in enumerate(names)]
    text_columns = [n for n, cell in enumerate(start[1][:width]) if not _is_number(cell) and cell]
    if len(text_columns) == width:
        _refuse_text(start, names, file)
    numbers, texts = array("d"), {n: list[str]() for n in text_columns}
    for number, cells in [start, *body[1:]]:
        _append_row(numbers, texts, cells, width, (f"{file}, line {number}", names))
    for number, cells in rows:
        _append_row(numbers, texts, cells, width, (f"{file}, line {number}", names))
    split = [split_unit(require_printable(name, f"{file}: the name of a column")) for name in names]
    found = [unit or _cell(units, n) for n, (_, unit) in enumerate(split)]
    values = np.array(numbers, dtype=np.float64).reshape(-1, width)
    return _Table([name for name, _ in split], found, values, texts)


def _cell(cells: Sequence[str], n: int) -> str:
    return cells[n] if n < len(cells) else ""


def _refuse_text(start: tuple[int, list[str]], names: Sequence[str], file: str) -> None:
    number, cells = start
    _parse_cell(cells[0], (f"{file}, line {number}", names), 0)


def _append_row(
    numbers: "array[float]",
    texts: dict[int, list[str]],
    cells: list[str],
    width: int,
    place: tuple[str, Sequence[str]],
) -> None:
    """Append the numbers of a row; NaN in columns of text."""
    if len(cells) < width or any(cells[width:]):
        raise InvalidInput(
            f"{place[0]} has {len(cells)} cells, expected {width}; complete the line, delete it if the "
            "recording was cut there, or check the separator"
        )
    try:
        if texts or any("_" in cell for cell in cells):
            raise ValueError
        numbers.extend([float(cell) for cell in cells[:width]])
    except ValueError:
        for n, cell in enumerate(cells[:width]):
            if n in texts:
                if _DECIMAL_COMMA.fullmatch(cell):
                    _parse_cell(cell, place, n)  # refuses it: the column would be lost as text
                texts[n].append(require_printable(cell, f"{place[0]}, column {place[1][n]!r}"))
            numbers.append(np.nan if n in texts else _parse_cell(cell, place, n))


def _parse_cell(cell: str, place: tuple[str, Sequence[str]], n: int) -> float:
    if not cell:
        return np.nan
    if _is_number(cell):
        return TRUTH[cell.lower()] if cell.lower() in TRUTH else float(cell)
    where = f"{place[0]}, column {short_repr(place[1][n])} is {short_repr(cell)}"
    if _DECIMAL_COMMA.fullmatch(cell):
        raise InvalidInput(
            f"{where}, a number with a decimal comma, expected a decimal point; export with points, or "
            "replace the commas: sed 's/,/./g'"
        )
    raise InvalidInput(f"{where}, expected a number such as 0.25; correct the cell, or delete the line")


def _is_number(cell: str) -> bool:
    if cell.lower() in TRUTH:
        return True
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # float accepts 1_0 as 10


def _to_recording(table: _Table, options: ReadOptions, path: Path) -> Recording:
    times, used = _find_times(table, options, str(path))
    columns = [n for n in range(len(table.names)) if n not in used and n not in table.texts]
    if not columns:
        raise InvalidInput(f"{path} has no columns of numbers besides the time, expected at least one")
    signal = Signal(
        "",
        np.ascontiguousarray(table.numbers[:, columns]),
        tuple(table.names[n] for n in columns),
        tuple(table.units[n] for n in columns),
        times,
    )
    labels = {table.names[n]: tuple(texts) for n, texts in table.texts.items() if n not in used}
    notes = tuple(_label_note(name, texts) for name, texts in labels.items())
    return Recording(path.stem, (signal,), labels, None, FORMAT, notes=notes)


def _label_note(name: str, texts: Sequence[str]) -> str:
    values = short_list(list(dict.fromkeys(texts)), 4)
    return f"column {short_repr(name)} has text ({values}): kept as a label of each row, not as a number"


def _find_times(
    table: _Table, options: ReadOptions, file: str
) -> tuple[Float[Array, " T"] | None, tuple[int, ...]]:
    """Return the times [s], and the columns that they are in."""
    pair = None if options.time_column else seconds_pair(table.names)
    if pair is not None:
        return table.numbers[:, pair[0]] + 1e-9 * table.numbers[:, pair[1]], pair
    column = find_time_column(table.names, options, file)
    if column is None:
        return None, ()
    label = f"{file}: column {table.names[column]!r}"
    if column in table.texts:
        return np.array([_parse_date(text, label) for text in table.texts[column]]), (column,)
    return to_seconds(table.numbers[:, column], table.units[column], options, label), (column,)


def _parse_date(text: str, label: str) -> float:
    try:
        date = datetime.fromisoformat(text)
        return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError) as error:
        raise InvalidInput(
            f"{label} has {short_repr(text)}, expected a time in s, or a date such as 2026-05-01T12:00:00.25"
        ) from error
