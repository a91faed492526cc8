"""Families of duration laws, and the most likely of each for expected visits: their M-steps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.models.durations import (
    Durations,
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormalDurations,
    PoissonDurations,
)
from pilotfish.models.durations_fit import Family, completed_visits, most_likely
from pilotfish.models.visits import Visits, lengths_seen
from pilotfish.types import Array, Float

WIDEST_LOG = 2.0  # deviation of log s; the mean of a wider law is a thousand times its median
LEAST_MORE = 1e-3  # mean steps after the first
BEYOND = 10.0  # means and deviations stay below so many times the longest visit that is followed
LEAST_TAIL = 1e-250  # a probability, of a visit so long or longer: quotients by it do not overflow
ROUNDS = 10  # of spreading visits that were cut off over the lengths that they may have had


@runtime_checkable
class DurationLaw(Protocol):
    """A family of laws of which visits choose one for each state."""

    @property
    def label(self) -> str:
        """A short name for tables and files, such as log-normal."""
        ...

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> Durations:
        """Durations at least as likely as previous for these visits, of variance floor [steps^2] or more.

        States without visits keep their law.
        """
        ...

    def parameter_count(self, states: int, longest: int) -> int:
        """Free numbers of the durations of so many states; longest is the length of a histogram's table."""
        ...


@dataclass(frozen=True, slots=True)
class Normal:
    """GaussianDurations, whose peak is at one step or later."""

    label: str = "normal"

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> GaussianDurations:
        """The floor is one for the variance before the density is cut."""
        if isinstance(previous, GaussianDurations):
            means, variances = previous.means, previous.deviations**2
        else:
            means, variances = lengths_seen(visits)
            variances = np.maximum(variances, floor)
        theta = np.stack([(means - 1.0) / variances, -0.5 / variances])
        family = _bounded(
            lambda s: np.stack([s - 1.0, (s - 1.0) ** 2], axis=1),
            _flat,
            theta,
            (0.0, -0.5 / floor),
            (np.inf, -0.5 / (BEYOND * len(visits.whole)) ** 2),
        )
        slope, curvature = most_likely(family, visits, theta, isinstance(previous, GaussianDurations))
        return GaussianDurations(1.0 - 0.5 * slope / curvature, np.sqrt(-0.5 / curvature))

    def parameter_count(self, states: int, longest: int) -> int:
        return 2 * states


@dataclass(frozen=True, slots=True)
class LogNormal:
    """LogNormalDurations, whose median is at one step or later."""

    label: str = "log-normal"

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> LogNormalDurations:
        """The floor is one for the variance about the mean length that was seen."""
        seen, variances = lengths_seen(visits)
        least = np.log1p(floor / seen**2)
        if isinstance(previous, LogNormalDurations):
            means, spreads = previous.log_means, previous.log_deviations**2
        else:
            spreads = np.clip(np.log1p(variances / seen**2), least, WIDEST_LOG**2)
            means = np.log(seen)
        theta = np.stack([means / spreads, -0.5 / spreads])
        family = _bounded(
            lambda s: np.stack([np.log(s), np.log(s) ** 2], axis=1),
            lambda s: -np.log(s)[:, None],
            theta,
            (0.0, -0.5 / least),
            (np.inf, -0.5 / WIDEST_LOG**2),
        )
        slope, curvature = most_likely(family, visits, theta, isinstance(previous, LogNormalDurations))
        return LogNormalDurations(-0.5 * slope / curvature, np.sqrt(-0.5 / curvature))

    def parameter_count(self, states: int, longest: int) -> int:
        return 2 * states


@dataclass(frozen=True, slots=True)
class Gamma:
    """GammaDurations."""

    label: str = "gamma"

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> GammaDurations:
        """The floor is one for the variance about the mean length that was seen."""
        seen, variances = lengths_seen(visits)
        if isinstance(previous, GammaDurations):
            shapes, rates = previous.shapes, previous.rates
        else:
            rates = seen / np.maximum(variances, floor)
            shapes = seen * rates
        theta = np.stack([shapes - 1.0, -rates])
        family = _bounded(
            lambda s: np.stack([np.log(s), s], axis=1),
            _flat,
            theta,
            (-0.99, -seen / floor),
            (1e6, -1.0 / (BEYOND * len(visits.whole))),
        )
        more, falling = most_likely(family, visits, theta, isinstance(previous, GammaDurations))
        return GammaDurations(1.0 + more, -falling)

    def parameter_count(self, states: int, longest: int) -> int:
        return 2 * states


@dataclass(frozen=True, slots=True)
class Poisson:
    """PoissonDurations. Their variance follows their mean, so the floor does not bear on them."""

    label: str = "poisson"

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> PoissonDurations:
        from scipy.special import gammaln  # here: scipy doubles the time of importing pilotfish

        more = previous.more if isinstance(previous, PoissonDurations) else lengths_seen(visits)[0] - 1.0
        most = BEYOND * len(visits.whole)
        theta = np.log(np.clip(more, LEAST_MORE, most))[None]
        family = _bounded(
            lambda s: s[:, None] - 1.0,
            lambda s: -gammaln(s)[:, None],
            theta,
            (np.log(LEAST_MORE),),
            (np.log(most),),
        )
        return PoissonDurations(
            np.exp(most_likely(family, visits, theta, isinstance(previous, PoissonDurations))[0])
        )

    def parameter_count(self, states: int, longest: int) -> int:
        return states


@dataclass(frozen=True, slots=True)
class Histogram:
    """HistogramDurations, every length up to the longest followed as probable as the visits say.

    pseudocount  visits that each state is given on top of its own, spread evenly over all lengths; with 0
                 lengths that were not seen have no probability
    """

    pseudocount: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.pseudocount < np.inf:
            raise InvalidInput(f"pseudocount is {self.pseudocount}, expected a number of at least 0")

    @property
    def label(self) -> str:
        return f"histogram({self.pseudocount:g})" if self.pseudocount else "histogram"

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> HistogramDurations:
        """The floor does not bear on it: free probabilities may say that every visit lasts alike.

        Visits whose ends were both seen need no rounds: their shares are the most likely law.
        Source: Vardi 1989, of lengths met at random, by alternating between them and the law.
        """
        S, K = visits.whole.shape
        if isinstance(previous, HistogramDurations):
            p = np.pad(previous.probabilities, ((0, max(0, S - len(previous.probabilities))), (0, 0)))
        else:
            p = np.full((S, K), 1.0 / S)
        steps = np.arange(1.0, len(p) + 1)[:, None]
        met = (visits.had_begun + visits.fills).sum(axis=0)
        fresh = (visits.whole + visits.goes_on).sum(axis=0) + self.pseudocount
        cut_off = visits.goes_on.any() or visits.had_begun.any() or visits.fills.any()
        for _ in range(ROUNDS if cut_off else 1):
            counts = _completed(p, visits) + self.pseudocount / len(p)
            likelier = _met_at_random(counts, fresh, met, steps)
            p = np.where(fresh + met > 0.0, likelier, p)
        return HistogramDurations(p)

    def parameter_count(self, states: int, longest: int) -> int:
        return states * (longest - 1)


def _completed(p: Float[Array, "N K"], visits: Visits) -> Float[Array, "N K"]:
    """completed_visits, with the probabilities as they are where they are no smaller than that allows."""
    total = np.pad(visits.whole, ((0, len(p) - len(visits.whole)), (0, 0)))
    for counts, order in ((visits.goes_on + visits.had_begun, 1), (visits.fills, 2)):
        if not counts.any():
            continue
        longer = p
        for _ in range(order):
            longer = longer[::-1].cumsum(axis=0)[::-1]
        known = longer[: len(counts)] >= LEAST_TAIL
        if (~known & (counts > 1e-30 * counts.sum(axis=0))).any():
            with np.errstate(divide="ignore"):
                return completed_visits(np.log(p), visits)
        weights = np.zeros_like(p)
        np.divide(counts, longer[: len(counts)], out=weights[: len(counts)], where=known)
        for _ in range(order):
            weights = weights.cumsum(axis=0)
        total += p * weights
    return total


def _met_at_random(
    counts: Float[Array, "S K"],
    fresh: Float[Array, " K"],
    met: Float[Array, " K"],
    steps: Float[Array, "S 1"],
) -> Float[Array, "S K"]:
    """The p that maximises sum_s counts log p(s) - met log sum_s s p(s), where counts sum to fresh + met.

    It is counts / (fresh + met s / mean), its mean the only one at which this sums to one.
    """
    none = fresh + met <= 0.0
    if not met.any():
        return np.asarray(counts / np.where(none, 1.0, fresh))
    fresh = np.where(none, 1.0, fresh)
    low, high = np.ones_like(met), np.full_like(met, float(len(steps)))
    for _ in range(60):
        mean = np.sqrt(low * high)
        short = (counts / (fresh + met * steps / mean)).sum(axis=0) < 1.0
        low, high = np.where(short, mean, low), np.where(short, high, mean)
    p = counts / (fresh + met * steps / high)
    return np.asarray(p / np.where(none, 1.0, p.sum(axis=0)))


def _bounded(
    statistics: Callable[[Float[Array, " S"]], Float[Array, "S Q"]],
    base: Callable[[Float[Array, " S"]], Float[Array, "S #K"]],
    start: Float[Array, "Q K"],
    lower: Sequence[float | Float[Array, " K"]],
    upper: Sequence[float],
) -> Family:
    """The family between these bounds, which give way to the start where it lies beyond them."""
    low, high = (
        np.stack([np.broadcast_to(one, start.shape[1:]) for one in bound]) for bound in (lower, upper)
    )
    return Family(statistics, base, np.minimum(low, start), np.maximum(high, start))


def _flat(steps: Float[Array, " S"]) -> Float[Array, "S 1"]:
    return np.zeros((len(steps), 1))
