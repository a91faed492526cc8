"""Alignment of the signals of a recording to one time base."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.build_settings import BuildSettings
from pilotfish.demonstrations.signals import Recording, Signal
from pilotfish.demonstrations.timestamps import (
    Between,
    even_times,
    held_run,
    rate_in_words,
    require_ascending,
    require_no_gap,
    rows_between,
    source_period,
    unheld_rows,
)
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import float_array, numeric_array, require_period

MAX_ROWS = 2**24  # of a demonstration
SAME = 1e-3  # of a period: time bases and ends that differ by less are the same


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """Rows of one signal that are used, and where the rows of the demonstration are among them.

    Attributes:
        rows: Rows of the signal that are used.
        between: Place of each row of the demonstration among them.
    """

    rows: Int[Array, " K"]
    between: Between


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """One time base for several signals.

    Attributes:
        times: Time of each row of the demonstration [s].
        period: Time between two rows [s].
        signals: The signals, by their number in the recording.
        lines: What was done, in words.
    """

    times: Float[Array, " T"]
    period: float
    signals: Mapping[int, Aligned]
    lines: tuple[str, ...]


def align_signals(
    recording: Recording,
    columns: Mapping[int, Sequence[int]],
    settings: BuildSettings,
    still: Collection[int] = (),
) -> Alignment:
    """Return one time base over the overlap of signals, and the place of its rows in each signal.

    A signal of a single row is valid at all times. A signal without times has those of a signal of equal
    length, or starts at 0 s with the period of the recording or of the settings.

    Args:
        recording: Recording.
        columns: Columns that are used, by the number of their signal; the first signal gives the period.
        settings: Period, thinning and longest gap.
        still: Signals of objects that do not move; their first and last rows are valid before and after.

    Raises:
        InvalidInput: If times do not ascend, are missing, have a gap, or do not overlap.
    """
    lines: list[str] = []
    times = {s: signal_times(recording, s, settings.period) for s in columns}
    rows = {s: _used_rows(recording.signals[s], columns[s], settings.thin, lines) for s in columns}
    used = {s: times[s][rows[s]] for s in columns}
    longer = {s: used[s] for s in columns if len(used[s]) > 1 and s not in still}
    if not longer:
        raise InvalidInput(f"recording {recording.name!r} has one row, expected at least two")
    period = settings.period or source_period(next(iter(longer.values())))
    base = _overlap(recording, longer, require_period(period))
    for s in still:
        _require_common_time(recording, s, used[s], base)
    lines += _resampling_lines(recording, longer, base, period)
    for s, own in longer.items():
        longest = settings.max_gap * max(period, float(np.median(np.diff(own))))
        require_no_gap(own, base, longest, signal_label(recording, s))
    aligned = {s: Aligned(rows[s], rows_between(used[s], base)) for s in columns}
    return Alignment(base, period, aligned, tuple(lines))


def signal_times(recording: Recording, number: int, period: float | None) -> Float[Array, " T"]:
    """Return the time of each row of a signal [s].

    Args:
        recording: Recording.
        number: Number of the signal, from 0.
        period: Period of the settings [s]; None if they give none.

    Raises:
        InvalidInput: If times do not ascend, or neither the file nor the settings give them.
    """
    signal, label = recording.signals[number], signal_label(recording, number)
    count = len(signal.values)
    if signal.times is not None:
        times = np.asarray(numeric_array(signal.times, f"{label}: times"))
        if times.shape != (count,):
            raise InvalidInput(f"{label} has {times.shape} times for {count} rows, expected one for each row")
        require_ascending(times, label)
        return times
    if count == 1:
        return np.zeros(1)
    timed = [s for s, other in enumerate(recording.signals) if other.times is not None]
    if same := [s for s in timed if len(recording.signals[s].values) == count]:
        return signal_times(recording, same[0], period)
    if timed:
        raise InvalidInput(
            f"{label} has no times, and {count} rows are not those of a signal with times; add a time column"
        )
    step = recording.period or period
    if step is None:
        raise InvalidInput(f"{label} has no times, and the file states no period; pass the period [s]")
    return require_period(step, f"{label}: period") * np.arange(count)


def signal_label(recording: Recording, number: int) -> str:
    """Return the name of a signal for messages and reports."""
    name = recording.signals[number].name
    if len(recording.signals) == 1 or not name:
        return f"recording {recording.name!r}" if recording.name else "the recording"
    return f"recording {recording.name!r}, {name}" if recording.name else name


def _used_rows(signal: Signal, columns: Sequence[int], thin: bool, lines: list[str]) -> Int[Array, " K"]:
    """Return the rows that are used; report rows that were held."""
    values = float_array(signal.values[:, list(columns)], "values")
    run = held_run(values) if thin and len(values) > 2 else 1
    if run == 1:
        return np.arange(len(values))
    rows = unheld_rows(values, run)
    name = f"{signal.name}: " if signal.name else ""
    lines.append(
        f"{name}each value is held for {run} rows; {len(rows)} of {len(values)} rows are used (a source "
        f"that is {run} times slower than the log)"
    )
    return rows


def _overlap(recording: Recording, times: Mapping[int, Array], period: float) -> Float[Array, " T"]:
    start, end = max(own[0] for own in times.values()), min(own[-1] for own in times.values())
    if end - start < period * (1 - SAME):
        spans = ", ".join(
            f"{signal_label(recording, s)} {own[0]:.9g} to {own[-1]:.9g} s" for s, own in times.items()
        )
        raise InvalidInput(
            f"the signals have less than two rows in common at a period of {period:.6g} s: {spans}; check "
            "that all times are of one clock and unit, or pass a shorter period"
        )
    if (end - start) / period > MAX_ROWS:
        raise InvalidInput(
            f"{end - start:.6g} s at a period of {period:.6g} s are more than {MAX_ROWS} rows; check the "
            "unit of the times, or pass a longer period"
        )
    return even_times(float(start), float(end), period)


def _require_common_time(recording: Recording, number: int, own: Array, base: Float[Array, " T"]) -> None:
    """Check that the signal of an object that does not move was recorded during the demonstration."""
    if len(own) > 1 and (own[-1] < base[0] or own[0] > base[-1]):
        raise InvalidInput(
            f"{signal_label(recording, number)} has times from {own[0]:.9g} to {own[-1]:.9g} s, expected "
            f"some from {base[0]:.9g} to {base[-1]:.9g} s; check that all times are of one clock and unit"
        )


def _resampling_lines(
    recording: Recording, times: Mapping[int, Array], base: Float[Array, " T"], period: float
) -> list[str]:
    lines = []
    several = len(times) > 1
    for s, own in times.items():
        steps = np.diff(own)
        name = recording.signals[s].name or "rows"
        if np.abs(steps - period).max() > SAME * period:
            rates = f"{1 / steps.max():.4g} to {1 / steps.min():.4g} Hz"
            if np.ptp(steps) <= SAME * period:
                rates = rate_in_words(float(np.median(steps)))
            lines.append(f"{name}: {len(own)} rows at {rates} resampled to {rate_in_words(period)}")
        before, after = int((own < base[0] - SAME * period).sum()), int((own > base[-1] + period).sum())
        if several and (before or after):
            lines.append(
                f"{name}: {before} rows before and {after} rows after the time that all signals cover are "
                "left out"
            )
    return lines
