"""What a stream is made of on its way to the model: recordings as pieces, and pieces cut where need be."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from pilotfish.demonstrations import Demonstration, views
from pilotfish.errors import InvalidInput
from pilotfish.models import online
from pilotfish.station.stream_lines import Break, Piece, Refusal, Rows

MANY = 4096  # datapoints of a recording that are learned before anyone looks up


def pieces_of_recordings(
    demonstrations: Sequence[Demonstration], stopped: Callable[[], int]
) -> Iterator[Piece]:
    """Each demonstration in turn, as its frames see it: all of them together are observe_demonstration."""
    for demo in demonstrations:
        if stopped():
            return
        yield Break()
        seen = np.ascontiguousarray(views([demo]).x.transpose(1, 0, 2))
        for start in range(0, len(seen), MANY):
            if stopped():
                return
            yield Rows(seen[start : start + MANY])


def require_like_model(model: online.OnlineModel, demonstrations: Iterable[Demonstration]) -> None:
    """Raises: InvalidInput, when a demonstration differs from the model in layout, period or frames."""
    expected = (", ".join(model.layout.names), f"{model.period:g} s", list(model.frame_names))
    for demo in demonstrations:
        has = (", ".join(demo.layout.names), f"{demo.period:g} s", [frame.name for frame in demo.frames])
        same = demo.layout == model.layout and demo.period == model.period and has[2] == expected[2]
        if not same:
            place = next((n for n in range(3) if has[n] != expected[n]), 0)
            what = ("columns", "period", "frames")[place]
            raise InvalidInput(
                f"demonstration {demo.name!r} and the model differ in {what}: {has[place]}, expected "
                f"{expected[place]}"
            )


def first_rows(pieces: Iterable[Piece], most: int | None) -> Iterator[Piece]:
    """The pieces, until so many rows have come; all, where there is no limit."""
    left = most
    for piece in pieces:
        if left is None or not isinstance(piece, Rows):
            yield piece
            continue
        rows = piece.x[:left]
        left -= len(rows)
        yield Rows(rows)
        if not left:
            return


def until_refused(pieces: Iterable[Piece]) -> Iterator[Piece]:
    """The pieces up to the first line that is refused, that one included."""
    for piece in pieces:
        yield piece
        if isinstance(piece, Refusal):
            return


def in_batches(pieces: Iterable[Piece], batch: int) -> Iterator[Piece]:
    """The same rows, as many at a time as make whole batches: when they came makes no difference.

    A break, or the end, ends a batch.
    """
    waiting: list[Rows] = []
    for piece in pieces:
        if not isinstance(piece, Rows):
            if isinstance(piece, Break):
                yield from _joined(waiting)
                waiting = []
            yield piece
            continue
        waiting.append(piece)
        held = sum(len(rows.x) for rows in waiting)
        if whole := held - held % batch:
            (rows,) = _joined(waiting)
            waiting = [Rows(rows.x[whole:])] if whole < held else []
            yield Rows(rows.x[:whole])
    yield from _joined(waiting)


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
