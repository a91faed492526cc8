"""What a stream is made of on its way to the model: recordings as pieces, and pieces cut where need be."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from pilotfish.cli.stream.lines import DemonstrationBreak, DemonstrationRows, RejectedLine, Rows, StreamEvent
from pilotfish.demonstrations import (
    Demonstration,
)
from pilotfish.errors import InvalidInput


def demonstration_events(
    demonstrations: Iterable[Demonstration], stopped: Callable[[], int]
) -> Iterator[StreamEvent]:
    """Each demonstration in turn."""
    for demo in demonstrations:
        if stopped():
            return
        yield DemonstrationRows(demo)


def take_rows(events: Iterable[StreamEvent], max_rows: int | None) -> Iterator[StreamEvent]:
    """The pieces, until so many datapoints have come; all, where there is no limit."""
    left = max_rows
    for event in events:
        if left is not None and isinstance(event, Rows | DemonstrationRows):
            event = truncate_event(event, left)
            left -= len(event.x if isinstance(event, Rows) else event.demonstration.x)
        yield event
        if left == 0:
            return


def truncate_event(event: Rows | DemonstrationRows, max_rows: int) -> Rows | DemonstrationRows:
    """The first so many datapoints of it."""
    if isinstance(event, Rows):
        return Rows(event.x[:max_rows])
    demo = event.demonstration
    frames = tuple(
        replace(frame, A=frame.A[:max_rows], b=frame.b[:max_rows]) if frame.is_moving else frame
        for frame in demo.frames
    )
    return DemonstrationRows(replace(demo, x=demo.x[:max_rows], frames=frames))


def stop_at_rejection(events: Iterable[StreamEvent]) -> Iterator[StreamEvent]:
    """The pieces up to the first line that is refused, that one included."""
    for event in events:
        yield event
        if isinstance(event, RejectedLine):
            return


def regroup_batches(events: Iterable[StreamEvent], batch: int) -> Iterator[StreamEvent]:
    """The same rows, as many at a time as make whole batches: when they came makes no difference.

    A break, or the end, ends a batch; where the stream breaks off, the rows that wait come before its error.
    """
    waiting: list[Rows] = []
    try:
        for event in events:
            if isinstance(event, Rows):
                whole, waiting = _split_full_batches([*waiting, event], batch)
                yield from whole
                continue
            if isinstance(event, DemonstrationBreak):
                yield from _concatenate(waiting)
                waiting = []
            yield event
    except InvalidInput:
        yield from _concatenate(waiting)
        raise
    yield from _concatenate(waiting)


def _split_full_batches(waiting: list[Rows], batch: int) -> tuple[list[Rows], list[Rows]]:
    """What makes whole batches, and what is left."""
    held = sum(len(rows.x) for rows in waiting)
    if not (whole := held - held % batch):
        return [], waiting
    (rows,) = _concatenate(waiting)
    return [Rows(rows.x[:whole])], [Rows(rows.x[whole:])] if whole < held else []


def batch_slices(rows: int, before: int, every: int | None, batch: int) -> Iterator[slice]:
    """Where rows are cut so that a multiple of every ends a slice, after the batch that holds it."""
    start = 0
    while start < rows:
        room = every - (before + start) % every if every else rows
        end = min(start + -(-room // batch) * batch, rows)
        yield slice(start, end)
        start = end


def _concatenate(waiting: list[Rows]) -> list[Rows]:
    return [Rows(np.concatenate([rows.x for rows in waiting]))] if waiting else []
