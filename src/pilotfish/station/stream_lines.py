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

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.kernels import LARGEST
from pilotfish.station.output import PATIENCE
from pilotfish.types import Array, Float

CHUNK = 2**16  # bytes that are read at once: as many as a pipe holds
LONGEST = 2**22  # bytes of a line
FEW = 16  # lines that are looked at one by one
UNPLAIN = re.compile(rb"[ \t\v\f\r_#]")  # beside commas: what reading at once cannot tell apart


@dataclass(frozen=True, slots=True)
class Columns:
    """How wide rows are, and what a first line calls their columns; no names, where there was none."""

    width: int
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Datapoints that follow one another."""

    x: Float[Array, "N *rest"]


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """Datapoints that are a demonstration, to be seen from its frames."""

    demonstration: Demonstration


@dataclass(frozen=True, slots=True)
class Break:
    """The next datapoint begins a demonstration."""


@dataclass(frozen=True, slots=True)
class Quiet:
    """Nothing came for a while."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """A line, from 1, that is no datapoint, and why."""

    line: int
    reason: str


Piece = Columns | Rows | Shown | Break | Quiet | Refusal


def rows_arriving(source: str, width: int | None, stopped: Callable[[], int]) -> Iterator[Piece]:
    """The rows of a file, or of standard input, as they come.    Raises: InvalidInput, when they cannot."""
    with source_of_lines(source) as descriptor:
        yield from pieces(lines(chunks(descriptor, stopped), stopped), width)


@contextmanager
def source_of_lines(source: str) -> Iterator[int]:
    """The descriptor of a file, or of standard input for "-".    Raises: InvalidInput, when there is none.

    A named pipe is opened also before it has a writer; it ends when its last writer closes it.
    """
    if source == "-":
        yield standard_input()
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


def standard_input() -> int:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError) as error:  # closed, or none at all
        raise InvalidInput("standard input is closed; expected rows of numbers there") from error


def chunks(descriptor: int, stopped: Callable[[], int]) -> Iterator[bytes]:
    """What arrives, as soon as it does; nothing after a while of nothing. It ends where the stream does."""
    while not stopped():
        ready, _, _ = select.select([descriptor], [], [], PATIENCE)
        if stopped():
            return
        if not ready:
            yield b""
            continue
        try:
            data = os.read(descriptor, CHUNK)
        except BlockingIOError:  # another reader of the same pipe was quicker
            yield b""
            continue
        except OSError as error:
            raise InvalidInput(f"the stream cannot be read any more: {error.strerror}") from error
        if not data:
            return
        yield data


def lines(arriving: Iterable[bytes], stopped: Callable[[], int]) -> Iterator[list[bytes]]:
    """The whole lines that each chunk completes; at the end the last one too, unless it was cut by a stop."""
    rest = b""
    for data in arriving:
        *whole, rest = (rest + data).replace(b"\r\n", b"\n").split(b"\n")
        yield whole
        if len(rest) > LONGEST:
            raise InvalidInput(f"a line has more than {LONGEST} bytes, expected a row of numbers a line")
    if rest and not stopped():
        yield [rest]


def pieces(arriving: Iterable[list[bytes]], width: int | None) -> Iterator[Piece]:
    """What the lines say: rows of that width, or of a header's or the first row's where it is not known.

    A first line of names is a header, a blank line is a break, one that begins with # a comment.
    """
    number, begun = 0, False  # lines that were read, and whether one had content
    for whole in arriving:
        end = number + len(whole)
        if not begun:
            if whole and number == 0:
                whole = [whole[0].removeprefix(BOM_UTF8), *whole[1:]]
            whole = list(dropwhile(lambda line: not has_content(line), whole))
            begun = bool(whole)
            if whole and (names := header(whole[0])):
                width = len(names)
                yield Columns(width, names)
                whole = whole[1:]
        if width is None and (width := first_width(whole)):
            yield Columns(width)
        yield from told(whole, end - len(whole), width) if whole else [Quiet()]
        number = end


def told(whole: list[bytes], number: int, width: int | None) -> Iterator[Piece]:
    """The same for some lines, of which so many came before: good ones at once, others among few."""
    if width is not None and (x := rows_at_once(whole, width)) is not None:
        yield Rows(x)
    elif len(whole) <= FEW:
        yield from one_by_one(whole, number, width)
    else:
        half = len(whole) // 2
        yield from told(whole[:half], number, width)
        yield from told(whole[half:], number + half, width)


def one_by_one(whole: list[bytes], number: int, width: int | None) -> Iterator[Piece]:
    """The same, every line on its own."""
    for place, line in enumerate(whole, number + 1):
        if has_content(line):
            row = row_of(line, width)
            yield Rows(np.array([row])) if isinstance(row, list) else Refusal(place, row)
        elif not line.strip():
            yield Break()


def first_width(whole: list[bytes]) -> int | None:
    """How many numbers the first good row among the lines has."""
    rows = (row_of(line, None) for line in whole if has_content(line))
    return next((len(row) for row in rows if isinstance(row, list)), None)


def has_content(line: bytes) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith(b"#")


def rows_at_once(whole: list[bytes], width: int) -> Float[Array, "N D"] | None:
    """All lines as rows, where each is a good one; None where they must be looked at one by one."""
    text = b"\n".join(whole)
    if b"," in text:
        text = text.replace(b", ", b",")
        if UNPLAIN.search(text):
            return None
        widths = {line.count(b",") + 1 for line in text.split(b"\n")}
        text = text.replace(b",", b" ")
    else:
        widths = {len(line.split()) for line in whole}
        if b"_" in text:  # float takes 1_0 for 10
            return None
    if widths != {width}:
        return None
    words = text.split()
    try:
        x = np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        return None
    good = x.size == len(whole) * width and bool((np.abs(x) <= LARGEST).all())
    return x.reshape(len(whole), width) if good else None


def row_of(line: bytes, width: int | None) -> list[float] | str:
    """The numbers of one line, or why it is refused."""
    words = fields(line)
    row = [number(word) for word in words]
    for n, (word, value) in enumerate(zip(words, row, strict=True), 1):
        if value is None:
            told = repr(word[:40].decode("utf-8", "replace")) if word else "empty"
            return f"column {n} is {told}, expected a number such as 0.25"
        if not isfinite(value) or abs(value) > LARGEST:
            return f"column {n} is {value:g}, expected a finite number of at most {LARGEST:g}"
    if width is not None and len(row) != width:
        return f"it has {len(row)} in place of {width} numbers"
    return [value for value in row if value is not None]


def fields(line: bytes) -> list[bytes]:
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


def header(line: bytes) -> tuple[str, ...]:
    """The names of columns that a first line holds; none, when any of them is a number, or empty."""
    text = line.decode("utf-8", "replace").strip()
    try:
        names = next(csv.reader([text], skipinitialspace=True)) if "," in text else text.split()
    except csv.Error:
        return ()
    named = all(name.strip() and number(name.strip().encode()) is None for name in names)
    return tuple(name.strip() for name in names) if named else ()
