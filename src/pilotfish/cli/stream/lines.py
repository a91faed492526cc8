"""Rows of numbers as they arrive, a line each: handed on at once, and many together when many are there."""

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

import numpy as np

from pilotfish.cli.output.terminal import WAIT_INTERVAL
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.kernels import MAX_VALUE
from pilotfish.types import Array, Float

CHUNK_BYTES = 2**16  # bytes that are read at once: as many as a pipe holds
MAX_LINE_BYTES = 2**22  # bytes of a line
MAX_LINES_PARSED_SINGLY = 16  # lines that are looked at one by one
SLOW_PATH_BYTES = re.compile(rb"[ \t\v\f\r_#]")  # beside commas: what reading at once cannot tell apart


@dataclass(frozen=True, slots=True)
class ColumnHeader:
    """How wide rows are, and what a first line calls their columns; no names, where there was none."""

    width: int
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Datapoints that follow one another."""

    x: Float[Array, "N *rest"]


@dataclass(frozen=True, slots=True, eq=False)
class DemonstrationRows:
    """Datapoints that are a demonstration, to be seen from its frames."""

    demonstration: Demonstration


@dataclass(frozen=True, slots=True)
class DemonstrationBreak:
    """The next datapoint begins a demonstration."""


@dataclass(frozen=True, slots=True)
class Idle:
    """Nothing came for a while."""


@dataclass(frozen=True, slots=True)
class RejectedLine:
    """A line, from 1, that is no datapoint, and why."""

    line: int
    reason: str


StreamEvent = ColumnHeader | Rows | DemonstrationRows | DemonstrationBreak | Idle | RejectedLine


def read_stream(source: str, width: int | None, stopped: Callable[[], int]) -> Iterator[StreamEvent]:
    """The rows of a file, or of standard input, as they come.    Raises: InvalidInput, when they cannot."""
    with open_source(source) as descriptor:
        yield from parse_lines(split_lines(read_chunks(descriptor, stopped), stopped), width)


@contextmanager
def open_source(source: str) -> Iterator[int]:
    """The descriptor of a file, or of standard input for "-".    Raises: InvalidInput, when there is none.

    A named pipe is opened also before it has a writer; it ends when its last writer closes it.
    """
    if source == "-":
        yield standard_input_descriptor()
        return
    try:
        descriptor = os.open(source, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", error)
        raise InvalidInput(
            f"{source} cannot be read: {reason}; expected -, a CSV file, a folder of recordings, or "
            "dataset:NAME"
        ) from error
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def standard_input_descriptor() -> int:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError) as error:  # closed, or none at all
        raise InvalidInput("standard input is closed; expected rows of numbers there") from error


def read_chunks(descriptor: int, stopped: Callable[[], int]) -> Iterator[bytes]:
    """What arrives, as soon as it does; nothing after a while of nothing. It ends where the stream does."""
    while not stopped():
        ready, _, _ = select.select([descriptor], [], [], WAIT_INTERVAL)
        if stopped():
            return
        if not ready:
            yield b""
            continue
        try:
            data = os.read(descriptor, CHUNK_BYTES)
        except BlockingIOError:  # another reader of the same pipe was quicker
            yield b""
            continue
        except OSError as error:
            raise InvalidInput(f"the stream cannot be read any more: {error.strerror}") from error
        if not data:
            return
        yield data


def split_lines(arriving: Iterable[bytes], stopped: Callable[[], int]) -> Iterator[list[bytes]]:
    """The whole lines that each chunk completes; at the end the last one too, unless it was cut by a stop."""
    rest = b""
    for data in arriving:
        *block, rest = (rest + data).replace(b"\r\n", b"\n").split(b"\n")
        yield block
        if len(rest) > MAX_LINE_BYTES:
            raise InvalidInput(
                f"a line has more than {MAX_LINE_BYTES} bytes, expected a row of numbers a line"
            )
    if rest and not stopped():
        yield [rest]


def parse_lines(arriving: Iterable[list[bytes]], width: int | None) -> Iterator[StreamEvent]:
    """What the lines say: rows of that width, or of a header's or the first row's where it is not known.

    A first line of names is a header, a blank line is a break, one that begins with # a comment.
    """
    number, begun = 0, False  # lines that were read, and whether one had content
    for block in arriving:
        end = number + len(block)
        if not begun:
            if block and number == 0:
                block = [block[0].removeprefix(BOM_UTF8), *block[1:]]
            block = list(dropwhile(lambda line: not has_content(line), block))
            begun = bool(block)
            if block and (names := parse_header(block[0])):
                width = len(names)
                yield ColumnHeader(width, names)
                block = block[1:]
        if width is None and (width := infer_width(block)):
            yield ColumnHeader(width)
        yield from parse_block(block, end - len(block), width) if block else [Idle()]
        number = end


def parse_block(block: list[bytes], number: int, width: int | None) -> Iterator[StreamEvent]:
    """The same for some lines, of which so many came before: good ones at once, others among few."""
    if width is not None and (x := parse_rows(block, width)) is not None:
        yield Rows(x)
    elif len(block) <= MAX_LINES_PARSED_SINGLY:
        yield from parse_single_lines(block, number, width)
    else:
        half = len(block) // 2
        yield from parse_block(block[:half], number, width)
        yield from parse_block(block[half:], number + half, width)


def parse_single_lines(block: list[bytes], number: int, width: int | None) -> Iterator[StreamEvent]:
    """The same, every line on its own."""
    for place, line in enumerate(block, number + 1):
        if has_content(line):
            row = parse_row(line, width)
            yield Rows(np.array([row])) if isinstance(row, list) else RejectedLine(place, row)
        elif not line.strip():
            yield DemonstrationBreak()


def infer_width(block: list[bytes]) -> int | None:
    """How many numbers the first good row among the lines has."""
    rows = (parse_row(line, None) for line in block if has_content(line))
    return next((len(row) for row in rows if isinstance(row, list)), None)


def has_content(line: bytes) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith(b"#")


def parse_rows(block: list[bytes], width: int) -> Float[Array, "N D"] | None:
    """All lines as rows, where each is a good one; None where they must be looked at one by one."""
    text = b"\n".join(block)
    if b"," in text:
        text = text.replace(b", ", b",")
        if SLOW_PATH_BYTES.search(text):
            return None
        widths = {line.count(b",") + 1 for line in text.split(b"\n")}
        text = text.replace(b",", b" ")
    else:
        widths = {len(line.split()) for line in block}
        if b"_" in text:  # float takes 1_0 for 10
            return None
    if widths != {width}:
        return None
    words = text.split()
    try:
        x = np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        return None
    good = x.size == len(block) * width and bool((np.abs(x) <= MAX_VALUE).all())
    return x.reshape(len(block), width) if good else None


def parse_row(line: bytes, width: int | None) -> list[float] | str:
    """The numbers of one line, or why it is refused."""
    words = split_fields(line)
    row = [number(word) for word in words]
    for n, (word, value) in enumerate(zip(words, row, strict=True), 1):
        if value is None:
            parse_block = repr(word[:40].decode("utf-8", "replace")) if word else "empty"
            return f"column {n} is {parse_block}, expected a number such as 0.25"
        if not isfinite(value) or abs(value) > MAX_VALUE:
            return f"column {n} is {value:g}, expected a finite number of at most {MAX_VALUE:g}"
    if width is not None and len(row) != width:
        return f"it has {len(row)} in place of {width} numbers"
    return [value for value in row if value is not None]


def split_fields(line: bytes) -> list[bytes]:
    """What stands between commas, and between blanks; nothing between two commas is a field too."""
    if b"," not in line:
        return line.split()
    return [word for part in line.split(b",") for word in part.split() or [b""]]


def number(word: bytes) -> float | None:
    if b"_" in word:  # float takes 1_0 for 10
        return None
    with suppress(ValueError):
        return float(word)
    return None


def parse_header(line: bytes) -> tuple[str, ...]:
    """The names of columns that a first line holds; none, when any of them is a number, or empty."""
    text = line.decode("utf-8", "replace").strip()
    try:
        names = next(csv.reader([text], skipinitialspace=True)) if "," in text else text.split()
    except csv.Error:
        return ()
    named = all(name.strip() and number(name.strip().encode()) is None for name in names)
    return tuple(name.strip() for name in names) if named else ()
