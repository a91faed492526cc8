"""Events of a stream on their way to the learner: truncated, and regrouped into full mini-batches."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from pilotfish.cli.stream.lines import ColumnHeader, RejectedLine, Rows, StreamEvent
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput


def demonstration_events(
    demonstrations: Iterable[Demonstration], stopped: Callable[[], int]
) -> Iterator[StreamEvent]:
    """Yield each demonstration until stopped."""
    for demo in demonstrations:
        if stopped():
            return
        yield demo


def take_rows(events: Iterable[StreamEvent], max_rows: int | None) -> Iterator[StreamEvent]:
    """Yield events until they have max_rows datapoints; all events if max_rows is None."""
    remaining = max_rows
    for event in events:
        if remaining is not None and isinstance(event, np.ndarray | Demonstration):
            event = truncate(event, remaining)
            remaining -= len(event) if isinstance(event, np.ndarray) else len(event.x)
        yield event
        if remaining == 0:
            return


def truncate(event: Rows | Demonstration, max_rows: int) -> Rows | Demonstration:
    """Return the first max_rows datapoints of an event, with their moving frames."""
    if isinstance(event, np.ndarray):
        return event[:max_rows]
    frames = tuple(
        replace(frame, A=frame.A[:max_rows], b=frame.b[:max_rows]) if frame.is_moving else frame
        for frame in event.frames
    )
    return replace(event, x=event.x[:max_rows], frames=frames)


def stop_at_rejection(events: Iterable[StreamEvent]) -> Iterator[StreamEvent]:
    """Yield events up to and including the first rejected line."""
    for event in events:
        yield event
        if isinstance(event, RejectedLine):
            return


def attach_first_rows(events: Iterable[StreamEvent], count: int) -> Iterator[StreamEvent]:
    """Hold rows back until there are `count` or a demonstration ends, and attach them to the column header.

    The held events then follow in order. Rejected lines and idle events are not held. If the stream fails or
    ends earlier, the rows that arrived are attached.

    Args:
        events: Events of the stream.
        count: Number of rows.
    """
    held: list[StreamEvent] = []  # from the header on, while rows are missing
    is_attached = False
    try:
        for event in events:
            is_header = isinstance(event, ColumnHeader)
            if is_attached or not (held or is_header) or _is_passed(event):
                yield event
                continue
            held.append(event)
            is_attached = _has_first_rows(held, count)
            if is_attached:
                yield from _with_first_rows(held, count)
    except InvalidInput:
        if not is_attached:
            yield from _with_first_rows(held, count)
        raise
    if not is_attached:
        yield from _with_first_rows(held, count)


def _is_passed(event: StreamEvent) -> bool:
    return isinstance(event, RejectedLine) or (isinstance(event, str) and event == "idle")


def _has_first_rows(held: list[StreamEvent], count: int) -> bool:
    """Return whether there are enough rows, or the first demonstration has ended."""
    rows = sum(len(event) for event in held if isinstance(event, np.ndarray))
    return rows >= count or (rows > 0 and not isinstance(held[-1], np.ndarray))


def _with_first_rows(held: list[StreamEvent], count: int) -> Iterator[StreamEvent]:
    rows = [event for event in held if isinstance(event, np.ndarray)]
    for event in held:
        if isinstance(event, ColumnHeader) and rows:
            yield replace(event, first_rows=np.concatenate(rows)[:count])
        else:
            yield event


def regroup_batches(events: Iterable[StreamEvent], batch: int) -> Iterator[StreamEvent]:
    """Regroup rows into full batches, so that the result does not depend on when rows arrived.

    A new demonstration, or the end of the stream, ends a batch. If the stream fails, the waiting rows are
    yielded before its error is raised.
    """
    waiting: list[Rows] = []
    try:
        for event in events:
            if isinstance(event, np.ndarray):
                full, waiting = _split_full_batches([*waiting, event], batch)
                yield from full
                continue
            if event == "new demonstration":
                yield from _concatenate(waiting)
                waiting = []
            yield event
    except InvalidInput:
        yield from _concatenate(waiting)
        raise
    yield from _concatenate(waiting)


def batch_slices(rows: int, before: int, every: int | None, batch: int) -> Iterator[slice]:
    """Cut rows so that a slice ends after each batch that contains a multiple of `every`.

    Args:
        rows: Number of rows to cut.
        before: Number of datapoints before them.
        every: Interval between printed lines [datapoints]; None cuts nothing.
        batch: Mini-batch size.

    Yields:
        Slices of the rows; all but the last contain full batches.
    """
    start = 0
    while start < rows:
        to_next_line = every - (before + start) % every if every else rows
        end = min(start + -(-to_next_line // batch) * batch, rows)
        yield slice(start, end)
        start = end


def _split_full_batches(waiting: list[Rows], batch: int) -> tuple[list[Rows], list[Rows]]:
    """Return the rows that fill batches, and the remaining rows."""
    count = sum(map(len, waiting))
    if not (full := count - count % batch):
        return [], waiting
    (x,) = _concatenate(waiting)
    return [x[:full]], [x[full:]] if full < count else []


def _concatenate(waiting: list[Rows]) -> list[Rows]:
    return [np.concatenate(waiting)] if waiting else []
