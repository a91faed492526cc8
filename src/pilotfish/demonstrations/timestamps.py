"""Times of rows: their unit, their order, the period behind them, and values between them."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from pilotfish.demonstrations.rotation_conversion import slerp
from pilotfish.demonstrations.units import TIME, parse_unit
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import finite_array, require_number, require_printable

# Seconds per unit, by the magnitude of a count since 1970 and by the median step.
EPOCH_UNITS = ((1e9, 1e10, "s"), (1e12, 1e13, "ms"), (1e15, 1e16, "us"), (1e18, 1e19, "ns"))
STEP_UNITS = ((0.0, 1.0, "s"), (1.0, 1e3, "ms"), (1e3, 1e6, "us"), (1e6, 1e12, "ns"))
ROUNDING = 1e-4  # of a step: a time this close to a row is that of the row, as times are printed in us
FIVES_TOLERANCE, WHOLE_RATE_TOLERANCE = 0.003, 0.0045  # of a measured rate
HELD_SHARE = 0.8  # of the runs of equal rows that must be equally long if the rows are held
MIN_RUNS = 5
DEFAULT_GAP = 10.0  # periods


def time_unit(times: object, unit: str = "", label: str = "times") -> str:
    """Return the unit of timestamps: the stated one, or s, ms, us or ns as their size reveals.

    A count since 1970 has a magnitude of 1e9 in s, 1e12 in ms, 1e15 in us and 1e18 in ns. For other times,
    the median step decides: below 1 it is in s, up to 1e3 in ms, up to 1e6 in us, above in ns. Steps of
    exactly 1 may be rows, seconds or milliseconds, and are refused unless a unit is stated.

    Args:
        times: Timestamps, ascending.
        unit: Unit that the file states; empty if it states none.
        label: Name of the column; messages begin with it.

    Raises:
        InvalidInput: If the unit is not one of time, or the unit cannot be recognised.
    """
    if require_printable(unit, f"{label}: unit"):
        if parse_unit(unit, f"{label}: unit").si != TIME:
            raise InvalidInput(f"{label}: unit is {unit!r}, expected a unit of time: s, ms, us or ns")
        return unit
    values = finite_array(times, label)
    if values.size < 2:
        return "s"
    for low, high, name in EPOCH_UNITS:
        if low <= abs(float(values.flat[0])) < high:
            return name
    step = float(np.median(np.abs(np.diff(values))))
    if step == 1.0:
        raise InvalidInput(
            f"{label} ascends by 1 per row, which may be s, ms or a number of the row; state its unit, as in "
            "'time [ms]', or leave the column out and pass the period"
        )
    return next((name for low, high, name in STEP_UNITS if low <= step < high), "ns")


def require_ascending(times: Float[Array, " T"], label: str) -> None:
    """Check that times are finite and ascend from row to row.

    Args:
        times: Time of each row [s].
        label: Name of the signal; messages begin with it.

    Raises:
        InvalidInput: If they do not; the message gives the row.
    """
    if (bad := np.flatnonzero(~np.isfinite(times))).size:
        raise InvalidInput(
            f"{label}: the time of row {bad[0]} (first is 0) is {times[bad[0]]}, expected a finite number "
            f"({bad.size} such rows); remove those rows"
        )
    if (bad := np.flatnonzero(np.diff(times) <= 0)).size:
        row = int(bad[0]) + 1
        what = "repeats" if times[row] == times[row - 1] else "is before"
        raise InvalidInput(
            f"{label}: the time of row {row} (first is 0), {times[row]:.9g} s, {what} that of the row before "
            f"({bad.size} such rows), expected times that ascend; remove those rows, or sort by time"
        )


def source_period(times: Float[Array, " T"]) -> float:
    """Return the period [s] behind measured times: the median step, rounded to a whole rate if it is near.

    From 100 Hz on, a multiple of 5 Hz within 0.3 percent is taken first, then a whole rate within 0.45
    percent: a median of 0.03337 s is a rate of 29.97 Hz, and the result is 1/30 s. Other medians are rounded
    to three digits.

    Args:
        times: At least two times that ascend [s].
    """
    step = float(np.median(np.diff(times)))
    rate: float = 1.0 / step
    fives, whole = 5 * round(rate / 5), round(rate)
    if rate >= 100 and abs(rate - fives) <= FIVES_TOLERANCE * rate:
        return 1.0 / fives
    if whole >= 1 and abs(rate - whole) <= WHOLE_RATE_TOLERANCE * rate:
        return 1.0 / whole
    return float(f"{step:.3g}")


def even_times(start: float, end: float, period: float) -> Float[Array, " S"]:
    """Return the times from start, one period apart, up to the end.

    Args:
        start: First time [s].
        end: Latest time [s]; a last time that misses it by rounding counts.
        period: Time between two rows [s].
    """
    steps = int((end - start) / period + 1e-3) + 1
    return np.asarray(start + period * np.arange(steps))


@dataclass(frozen=True, slots=True, eq=False)
class Between:
    """Rows of a signal before and after each of some times, and the fraction of the way.

    Attributes:
        before: Row at or before each time.
        fraction: 0 at that row, 1 at the next one.
    """

    before: Int[Array, " S"]
    fraction: Float[Array, " S"]

    @property
    def after(self) -> Int[Array, " S"]:
        """Row after each time; the row itself where the fraction is 0."""
        return self.before + (self.fraction > 0)

    @property
    def nearest(self) -> Int[Array, " S"]:
        """Row nearest in time; the later one in the middle."""
        return np.asarray(np.where(self.fraction >= 0.5, self.after, self.before))

    def interpolate(self, values: Float[Array, "T d"]) -> Float[Array, "S d"]:
        """Return values at the times, interpolated linearly; exact at rows.

        Args:
            values: One row per row of the signal.
        """
        fraction = self.fraction[:, None]
        before, after = values[self.before], values[self.after]
        return np.asarray(np.where(fraction == 0, before, (1 - fraction) * before + fraction * after))

    def interpolate_rotations(self, q: Float[Array, "T 4"]) -> Float[Array, "S 4"]:
        """Return unit quaternions at the times by slerp; exact at rows.

        Args:
            q: Unit quaternions w x y z whose signs do not change from row to row.
        """
        before, after = q[self.before], q[self.after]
        return np.asarray(np.where(self.fraction[:, None] == 0, before, slerp(before, after, self.fraction)))


def rows_between(times: Float[Array, " T"], at: Float[Array, " S"]) -> Between:
    """Return where times are among the rows of a signal.

    A time within 1e-4 of a step of a row is that of the row. Times outside the signal get its first or last
    row.

    Args:
        times: Times of the rows, which ascend [s]; a single row is valid at all times.
        at: Times to look up [s].
    """
    if len(times) == 1:
        return Between(np.zeros(len(at), dtype=np.int64), np.zeros(len(at)))
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    steps = times[before + 1] - times[before]
    fraction = np.clip((at - times[before]) / steps, 0.0, 1.0)
    fraction = np.where(fraction < ROUNDING, 0.0, fraction)
    is_next = fraction > 1.0 - ROUNDING
    return Between(before + is_next, np.where(is_next, 0.0, fraction))


def require_no_gap(times: Float[Array, " T"], at: Float[Array, " S"], longest: float, label: str) -> None:
    """Check that no gap between two rows that are interpolated is longer than a limit.

    Args:
        times: Times of the rows [s].
        at: Times at which the signal is interpolated [s].
        longest: Limit [s].
        label: Name of the signal; the message begins with it.

    Raises:
        InvalidInput: If a gap is longer; the message gives its time and the remedy.
    """
    steps = np.diff(times)
    inside = (times[1:] > at[0]) & (times[:-1] < at[-1])
    if (bad := np.flatnonzero((steps > longest * (1 + ROUNDING)) & inside)).size:
        row = int(bad[0])
        raise InvalidInput(
            f"{label}: no rows for {steps[row]:.3g} s after {times[row]:.9g} s (row {row}, first is 0; "
            f"{bad.size} such gaps), expected at most {longest:.3g} s; split the recording there, or raise "
            "max_gap"
        )


def held_run(values: Float[Array, "T d"]) -> int:
    """Return how many equal rows in a row a slower source left in a faster log; 1 if rows are not held.

    Rows are held if at least 80 percent of the runs of equal rows are equally long within one row, or a tenth
    of a long run. A robot that stands still for a while has one long run among short ones, which is not held.

    Args:
        values: Rows of a signal.
    """
    changes = np.flatnonzero((values[1:] != values[:-1]).any(axis=1)) + 1
    runs = np.diff(changes)
    if len(runs) < MIN_RUNS:
        return 1
    length = int(np.median(runs))
    tolerance = max(1, length // 10) if length > 2 else 0
    share = float((np.abs(runs - length) <= tolerance).mean())
    return length if share >= HELD_SHARE else 1


def unheld_rows(values: Float[Array, "T d"], run: int) -> Int[Array, " K"]:
    """Return the rows that a slower source measured: those that change, and every run-th of a longer rest.

    Args:
        values: Rows of a signal.
        run: Number of equal rows for each measured one, from `held_run`.
    """
    changed = np.concatenate([[True], (values[1:] != values[:-1]).any(axis=1)])
    starts = np.flatnonzero(changed)
    since = np.arange(len(values)) - starts[np.cumsum(changed) - 1]
    rest = np.diff(np.append(starts, len(values)))[np.cumsum(changed) - 1]
    whole = (since % run == 0) & (rest - since >= run)  # a remainder is not another measured row
    return np.flatnonzero(changed | whole).astype(np.int64)


def rate_in_words(period: float) -> str:
    """Return a period as a rate: "30 Hz", or "0.25 Hz" where it is not whole.

    Args:
        period: Time between two rows [s].
    """
    rate = Fraction(1.0 / require_number(period, "period", 1e-9, 1e9)).limit_denominator(1000)
    return f"{float(rate):.4g} Hz"
