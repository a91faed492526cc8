"""Statistics of the study: success, and ratios of paired runs with bootstrap intervals.

Only pairs in which both runs succeeded enter a ratio. With such values x and reference values y of n pairs,

    ratio = (x_1 + ... + x_n) / (y_1 + ... + y_n),

the ratio of means. Its 95 % interval has the 2.5 and 97.5 % quantiles of the ratios of 2000 resamples of
the pairs, drawn with replacement. There is "no gain" where 1 lies inside the interval.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_count

RESAMPLES = 2000
LEVEL = 0.95
EQUAL_TIMES = 1.05  # ratio up to which two mean times count as equal
LOWER, NO_GAIN, HIGHER, TOO_FEW = "lower", "no gain", "higher", "too few pairs"


@dataclass(frozen=True, slots=True)
class Ratio:
    """Ratio of the means of paired values.

    Attributes:
        value: Ratio; nan without pairs.
        low: Lower end of the interval; nan if there are less than two pairs.
        high: Upper end.
        pairs: Number of pairs.
    """

    value: float
    low: float
    high: float
    pairs: int

    @property
    def verdict(self) -> str:
        """Whether the ratio is lower or higher than 1, or no gain; too few pairs for an interval."""
        if not self.low <= self.high:
            return TOO_FEW
        return LOWER if self.high < 1.0 else HIGHER if self.low > 1.0 else NO_GAIN


@dataclass(frozen=True, slots=True)
class ModeSummary:
    """What decides which mode is preferred.

    Attributes:
        mode: Mode.
        successes: Number of runs that succeeded.
        time: Mean time of those [s]; infinite if there are none.
        effort: Their mean path of the hand [m].
    """

    mode: str
    successes: int
    time: float
    effort: float


def paired_ratio(
    values: Mapping[int, float],
    reference: Mapping[int, float],
    rng: np.random.Generator,
    *,
    resamples: int = RESAMPLES,
) -> Ratio:
    """Return the ratio of the means of paired values, with its bootstrap interval.

    Args:
        values: Value of each run that succeeded, by its number.
        reference: The same of the runs to compare with.
        rng: Generator of the resamples.
        resamples: Number of resamples.

    Raises:
        InvalidInput: If a value is not finite, or a reference value is not positive.
    """
    numbers = sorted(values.keys() & reference.keys())
    require_count(resamples, "resamples", 10**6, minimum=1)
    if not numbers:
        return Ratio(np.nan, np.nan, np.nan, 0)
    x = finite_array([values[n] for n in numbers], "values")
    y = finite_array([reference[n] for n in numbers], "reference")
    if (y <= 0.0).any():
        raise InvalidInput(
            f"reference has {y.min():g}, expected positive values; compare with another measure"
        )
    low, high = np.nan, np.nan
    if len(numbers) > 1:
        drawn = rng.integers(len(numbers), size=(resamples, len(numbers)))
        low, high = _interval(x[drawn].sum(axis=1) / y[drawn].sum(axis=1))
    return Ratio(float(x.sum() / y.sum()), low, high, len(numbers))


def _interval(values: Float[Array, " N"]) -> tuple[float, float]:
    low, high = np.quantile(values, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return float(low), float(high)


def preferred_mode(modes: Sequence[ModeSummary]) -> str:
    """Return the mode with the most successes, then the shortest time, then the least effort.

    Mean times up to 5 % above the shortest one count as equal.

    Args:
        modes: Modes to compare, at least one.

    Raises:
        InvalidInput: If modes is empty.
    """
    if not modes:
        raise InvalidInput("modes is empty, expected at least one ModeSummary")
    most = max(mode.successes for mode in modes)
    best = [mode for mode in modes if mode.successes == most]
    shortest = min(mode.time for mode in best)
    fast = [mode for mode in best if mode.time <= EQUAL_TIMES * shortest]
    return min(fast, key=lambda mode: mode.effort).mode
