"""Rows of numbers from a file or pipe, as events of a stream.

Rows are parsed as soon as they arrive. Lines that are available together are parsed together, with the same
result as one by one: `parse_rows` parses a whole block, and declines any block in which `parse_row` could
reject a line. Such a block is split in halves until it parses, or has few enough lines to parse singly.
"""

import csv
import os
import re
import select
import sys
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import dropwhile
from math import isfinite
from typing import Literal

import numpy as np

from pilotfish.cli.output.terminal import WAIT_INTERVAL
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.kernels import MAX_VALUE
from pilotfish.types import Array, Float

CHUNK_BYTES = 2**16  # bytes read at once: the capacity of a pipe
MAX_LINE_BYTES = 2**22
MAX_LINES_PARSED_SINGLY = 16
SLOW_PATH_BYTES = re.compile(rb"[ \t\v\f\r_#]")  # beside commas: not distinguished when a block is parsed


@dataclass(frozen=True, slots=True)
class ColumnHeader:
    """Columns of the rows that follow.

    Attributes:
        width: Number of columns.
        names: Names of the columns from the first line; empty if it has none.
        first_rows: First rows of the stream if the model is created from them; they follow the header, too.
    """

    width: int
    names: tuple[str, ...] = ()
    first_rows: Float[Array, "N D"] | None = None


@dataclass(frozen=True, slots=True)
class RejectedLine:
    """Line that is not a datapoint.

    Attributes:
        line: Number of the line, from 1.
        reason: What is wrong with it.
    """

    line: int
    reason: str


Rows = Float[Array, "_ ..."]  # axes without names: a list may hold arrays of different lengths
# "new demonstration": the next row begins one; "idle": nothing arrived for a while.
StreamEvent = ColumnHeader | Rows | Demonstration | RejectedLine | Literal["new demonstration", "idle"]


def read_stream(source: str, width: int | None, stopped: Callable[[], int]) -> Iterator[StreamEvent]:
    """Read the rows of a file or of standard input as they arrive.

    Args:
        source: Path of a file or named pipe, or "-" for standard input.
        width: Number of columns; None takes it from the header or the first row.
        stopped: Returns whether to stop reading.

    Yields:
        Events of the stream.

    Raises:
        InvalidInput: If the source cannot be read.
    """
    with open_source(source) as descriptor:
        yield from parse_lines(split_lines(read_chunks(descriptor, stopped), stopped), width)


@contextmanager
def open_source(source: str) -> Iterator[int]:
    """Open a file, or standard input for "-".

    A named pipe is opened before it has a writer; it ends when its last writer closes it.

    Args:
        source: Path, or "-".

    Yields:
        File descriptor.

    Raises:
        InvalidInput: If it cannot be opened.
    """
    if source == "-":
        yield standard_input_descriptor()
        return
    try:
        descriptor = os.open(source, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", error)
        raise InvalidInput(
            f"{source} cannot be read: {reason}; expected -, a CSV file, a folder of demonstrations, or "
            "dataset:NAME"
        ) from error
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def standard_input_descriptor() -> int:
    """Return the descriptor of standard input, or raise InvalidInput if it is closed."""
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError) as error:  # None, closed, or not a file
        raise InvalidInput("standard input is closed, expected rows of numbers; pipe them in") from error


def read_chunks(descriptor: int, stopped: Callable[[], int]) -> Iterator[bytes]:
    """Yield bytes as soon as they arrive, and empty bytes after WAIT_INTERVAL without any."""
    while not stopped():
        ready, _, _ = select.select([descriptor], [], [], WAIT_INTERVAL)
        if stopped():
            return
        if not ready:
            yield b""
            continue
        try:
            data = os.read(descriptor, CHUNK_BYTES)
        except BlockingIOError:  # another reader of the pipe was faster
            yield b""
            continue
        except OSError as error:
            raise InvalidInput(
                f"the stream cannot be read: {error.strerror}; resume with --resume"
            ) from error
        if not data:
            return
        yield data


def split_lines(chunks: Iterable[bytes], stopped: Callable[[], int]) -> Iterator[list[bytes]]:
    """Yield the lines that each chunk completes; the last line needs no line break, unless stopped."""
    rest = b""
    for data in chunks:
        *block, rest = (rest + data).replace(b"\r\n", b"\n").split(b"\n")
        yield block
        if len(rest) > MAX_LINE_BYTES:
            raise InvalidInput(
                f"a line has more than {MAX_LINE_BYTES} bytes, expected one row of numbers per line"
            )
    if rest and not stopped():
        yield [rest]


def parse_lines(blocks: Iterable[list[bytes]], width: int | None) -> Iterator[StreamEvent]:
    """Parse blocks of lines.

    A first line of names is a header, a blank line begins a demonstration, and a line that begins with # is
    a comment.

    Args:
        blocks: Lines, as they arrive.
        width: Number of columns; None takes it from the header or the first row.

    Yields:
        Events of the stream.
    """
    line, has_started = 0, False  # lines that were read, and whether one of them had content
    for block in blocks:
        end = line + len(block)
        if not has_started:
            if block and line == 0:
                block = [block[0].removeprefix(BOM_UTF8), *block[1:]]
            block = list(dropwhile(lambda text: not has_content(text), block))
            has_started = bool(block)
            if block and (names := parse_header(block[0])):
                width = len(names)
                yield ColumnHeader(width, names)
                block = block[1:]
        if width is None and (width := infer_width(block)):
            yield ColumnHeader(width)
        if block:
            yield from parse_block(block, end - len(block), width)
        else:
            yield "idle"
        line = end


def parse_block(block: list[bytes], first: int, width: int | None) -> Iterator[StreamEvent]:
    """Parse a block of lines together if possible, else in halves; `first` lines precede it."""
    if width is not None and (x := parse_rows(block, width)) is not None:
        yield x
    elif len(block) <= MAX_LINES_PARSED_SINGLY:
        yield from parse_single_lines(block, first, width)
    else:
        half = len(block) // 2
        yield from parse_block(block[:half], first, width)
        yield from parse_block(block[half:], first + half, width)


def parse_single_lines(block: list[bytes], first: int, width: int | None) -> Iterator[StreamEvent]:
    """Parse every line of a block by itself."""
    for number, line in enumerate(block, first + 1):
        if has_content(line):
            row = parse_row(line, width)
            yield np.array([row]) if isinstance(row, list) else RejectedLine(number, row)
        elif not line.strip():
            yield "new demonstration"


def infer_width(block: list[bytes]) -> int | None:
    """Return the number of values of the first valid row; None if no row is valid."""
    rows = (parse_row(line, None) for line in block if has_content(line))
    return next((len(row) for row in rows if isinstance(row, list)), None)


def has_content(line: bytes) -> bool:
    """Return whether a line is neither blank nor a comment."""
    return bool(line.strip()) and not line.lstrip().startswith(b"#")


def parse_rows(block: list[bytes], width: int) -> Float[Array, "N D"] | None:
    """Return all lines as rows; None if the lines must be parsed one by one."""
    text = b"\n".join(block)
    if b"," in text:
        text = text.replace(b", ", b",")
        if SLOW_PATH_BYTES.search(text):
            return None
        widths = {line.count(b",") + 1 for line in text.split(b"\n")}
        text = text.replace(b",", b" ")
    else:
        widths = {len(line.split()) for line in block}
        if b"_" in text:  # float accepts 1_0 as 10
            return None
    if widths != {width}:
        return None
    words = text.split()
    try:
        x = np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        return None
    is_valid = x.size == len(block) * width and bool((np.abs(x) <= MAX_VALUE).all())
    return x.reshape(len(block), width) if is_valid else None


def parse_row(line: bytes, width: int | None) -> list[float] | str:
    """Return the numbers of a line, or the reason why it is rejected."""
    words = split_fields(line)
    row = [parse_number(word) for word in words]
    for n, (word, value) in enumerate(zip(words, row, strict=True), 1):
        if value is None:
            text = repr(word[:40].decode("utf-8", "replace")) if word else "empty"
            return f"column {n} is {text}, expected a number such as 0.25"
        if not isfinite(value) or abs(value) > MAX_VALUE:
            return f"column {n} is {value:g}, expected a finite number of at most {MAX_VALUE:g}"
    if width is not None and len(row) != width:
        return f"the row has {len(row)} numbers, expected {width}"
    return [value for value in row if value is not None]


def split_fields(line: bytes) -> list[bytes]:
    """Split a line at commas and blanks; two consecutive commas enclose an empty field."""
    if b"," not in line:
        return line.split()
    return [word for part in line.split(b",") for word in part.split() or [b""]]


def parse_number(word: bytes) -> float | None:
    """Return a number, which may be infinite or nan; None if the text is not a number."""
    if b"_" in word:  # float accepts 1_0 as 10
        return None
    with suppress(ValueError):
        return float(word)
    return None


def parse_header(line: bytes) -> tuple[str, ...]:
    """Return the column names of a first line; empty if any field is a number or empty."""
    text = line.decode("utf-8", "replace").strip()
    try:
        fields = next(csv.reader([text], skipinitialspace=True)) if "," in text else text.split()
    except csv.Error:
        return ()
    names = tuple(name.strip() for name in fields)
    return names if all(name and parse_number(name.encode()) is None for name in names) else ()
