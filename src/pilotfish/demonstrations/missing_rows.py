"""Rows of recordings without a value or with the time of the row before: they are left out and reported.

A tracker that loses its marker writes NaN or empty cells, and a log sometimes has a message twice. What
remains is interpolated, up to the longest gap of `BuildSettings`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations.signal_alignment import signal_label, signal_times
from pilotfish.demonstrations.signals import Recording, Signal
from pilotfish.demonstrations.timestamps import require_ascending
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float

MAX_REPEATED = 0.05  # of the rows: more equal times mean a clock that is too coarse


def drop_missing_rows(
    recording: Recording, columns: Mapping[int, Sequence[int]], period: float | None
) -> tuple[Recording, tuple[str, ...]]:
    """Return a recording without rows that have no value or repeat a time, and what was left out.

    Args:
        recording: Recording.
        columns: Columns that are used, by the number of their signal.
        period: Period of the settings [s]; None if they give none.

    Raises:
        InvalidInput: If a signal has no row with values, or its times are missing, repeat too often or do not
            ascend.
    """
    kept = {s: _kept_rows(recording, s, used) for s, used in columns.items()}
    if all(rows.all() for rows in kept.values()):
        return recording, ()
    signals, lines = list(recording.signals), list[str]()
    for s, rows in kept.items():
        signal = recording.signals[s]
        times = _timed(recording, s, rows, period)
        signals[s] = replace(signal, values=signal.values[rows], times=times)
        if missing := int((~_has_values(signal, columns[s])).sum()):
            lines.append(f"{_name(signal)}: {missing} of {len(rows)} rows without values are left out")
        if repeated := int((~rows).sum()) - missing:
            lines.append(
                f"{_name(signal)}: {repeated} rows that repeat the time of the row before are left out"
            )
    return replace(recording, signals=tuple(signals)), tuple(lines)


def _kept_rows(recording: Recording, s: int, used: Sequence[int]) -> Bool[Array, " T"]:
    """Return the rows with a value in each used column and a time of their own."""
    signal, label = recording.signals[s], signal_label(recording, s)
    rows = _has_values(signal, used)
    if not rows.any():
        names = ", ".join(repr(signal.columns[column]) for column in used)
        raise InvalidInput(f"{label}: no row has values in all of {names}; leave these columns out")
    if (times := _finite_times(signal)) is None:
        return rows
    repeats = np.concatenate([[False], np.diff(times) == 0])
    if 0 < repeats.sum() <= MAX_REPEATED * len(rows):
        rows &= ~repeats
    return rows


def _has_values(signal: Signal, used: Sequence[int]) -> Bool[Array, " T"]:
    return np.asarray(np.isfinite(signal.values[:, list(used)]).all(axis=1))


def _finite_times(signal: Signal) -> Float[Array, " T"] | None:
    """Return the times of a signal; None if it has none, or they cannot be used, which is reported later."""
    times = signal.times
    if not isinstance(times, np.ndarray) or times.shape != (len(signal.values),) or times.dtype.kind != "f":
        return None
    return times if np.isfinite(times).all() else None


def _timed(recording: Recording, s: int, rows: Bool[Array, " T"], period: float | None) -> Float[Array, " K"]:
    """Return the times of the rows that remain: those of the file, or of the period."""
    own = _finite_times(recording.signals[s])
    times = signal_times(recording, s, period) if own is None else own
    require_ascending(times[rows], signal_label(recording, s))
    return np.asarray(times[rows])


def _name(signal: Signal) -> str:
    return signal.name or "rows"
