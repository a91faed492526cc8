"""What a stream is made of on its way to the model: recordings as pieces, and pieces cut where need be."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Demonstration, MovingFrame
from pilotfish.errors import InvalidInput
from pilotfish.station.stream_lines import Break, Piece, Refusal, Rows, Shown


def pieces_of_recordings(
    demonstrations: Iterable[Demonstration], stopped: Callable[[], int]
) -> Iterator[Piece]:
    """Each demonstration in turn."""
    for demo in demonstrations:
        if stopped():
            return
        yield Shown(demo)


def first_rows(pieces: Iterable[Piece], most: int | None) -> Iterator[Piece]:
    """The pieces, until so many datapoints have come; all, where there is no limit."""
    left = most
    for piece in pieces:
        if left is not None and isinstance(piece, Rows | Shown):
            piece = shortened(piece, left)
            left -= len(piece.x if isinstance(piece, Rows) else piece.demonstration.x)
        yield piece
        if left == 0:
            return


def shortened(piece: Rows | Shown, most: int) -> Rows | Shown:
    """The first so many datapoints of it."""
    if isinstance(piece, Rows):
        return Rows(piece.x[:most])
    demo = piece.demonstration
    frames = tuple(
        replace(frame, A=frame.A[:most], b=frame.b[:most]) if isinstance(frame, MovingFrame) else frame
        for frame in demo.frames
    )
    return Shown(replace(demo, x=demo.x[:most], frames=frames))


def until_refused(pieces: Iterable[Piece]) -> Iterator[Piece]:
    """The pieces up to the first line that is refused, that one included."""
    for piece in pieces:
        yield piece
        if isinstance(piece, Refusal):
            return


def in_batches(pieces: Iterable[Piece], batch: int) -> Iterator[Piece]:
    """The same rows, as many at a time as make whole batches: when they came makes no difference.

    A break, or the end, ends a batch; where the stream breaks off, the rows that wait come before its error.
    """
    waiting: list[Rows] = []
    try:
        for piece in pieces:
            if isinstance(piece, Rows):
                whole, waiting = _whole_batches([*waiting, piece], batch)
                yield from whole
                continue
            if isinstance(piece, Break):
                yield from _joined(waiting)
                waiting = []
            yield piece
    except InvalidInput:
        yield from _joined(waiting)
        raise
    yield from _joined(waiting)


def _whole_batches(waiting: list[Rows], batch: int) -> tuple[list[Rows], list[Rows]]:
    """What makes whole batches, and what is left."""
    held = sum(len(rows.x) for rows in waiting)
    if not (whole := held - held % batch):
        return [], waiting
    (rows,) = _joined(waiting)
    return [Rows(rows.x[:whole])], [Rows(rows.x[whole:])] if whole < held else []


def cuts(rows: int, before: int, every: int | None, batch: int) -> Iterator[slice]:
    """Where rows are cut so that a multiple of every ends a slice, after the batch that holds it."""
    start = 0
    while start < rows:
        room = every - (before + start) % every if every else rows
        end = min(start + -(-room // batch) * batch, rows)
        yield slice(start, end)
        start = end


def _joined(waiting: list[Rows]) -> list[Rows]:
    return [Rows(np.concatenate([rows.x for rows in waiting]))] if waiting else []
