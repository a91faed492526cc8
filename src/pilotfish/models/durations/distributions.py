"""Families of duration laws, and the most likely of each for expected visits: their M-steps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.models.durations.fit import ExponentialFamily, complete_segments, fit_parameters
from pilotfish.models.durations.values import (
    Durations,
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormalDurations,
    PoissonDurations,
)
from pilotfish.models.segments import Segments, recorded_length_moments
from pilotfish.types import Array, Float

MAX_LOG_DEVIATION = 2.0  # deviation of log s; the mean of a wider law is a thousand times its median
MIN_RATE = 1e-3  # mean steps after the first
MAX_RELATIVE_DURATION = (
    10.0  # means and deviations stay below so many times the longest visit that is followed
)
MIN_TAIL_PROBABILITY = 1e-250  # a probability, of a visit so long or longer: quotients by it do not overflow
MAX_ITERATIONS = 10  # of spreading visits that were cut off over the lengths that they may have had


@runtime_checkable
class DurationDistribution(Protocol):
    """A family of laws of which visits choose one for each state."""

    @property
    def label(self) -> str:
        """A short name for tables and files, such as log-normal."""
        ...

    def estimate(self, segments: Segments, previous: Durations | None, min_variance: float) -> Durations:
        """Durations at least as likely as previous for these visits, of variance floor [steps^2] or more.

        States without visits keep their law.
        """
        ...

    def parameter_count(self, states: int, max_duration: int) -> int:
        """Free numbers of the durations of so many states; longest is the length of a histogram's table."""
        ...


@dataclass(frozen=True, slots=True)
class Gaussian:
    """GaussianDurations, whose peak is at one step or later."""

    label: str = "gaussian"

    def estimate(
        self, segments: Segments, previous: Durations | None, min_variance: float
    ) -> GaussianDurations:
        """The floor is one for the variance before the density is cut."""
        if isinstance(previous, GaussianDurations):
            means, variances = previous.means, previous.deviations**2
        else:
            means, variances = recorded_length_moments(segments)
            variances = np.maximum(variances, min_variance)
        theta = np.stack([(means - 1.0) / variances, -0.5 / variances])
        family = _bounded_family(
            lambda s: np.stack([s - 1.0, (s - 1.0) ** 2], axis=1),
            _zero_log_base,
            theta,
            (0.0, -0.5 / min_variance),
            (np.inf, -0.5 / (MAX_RELATIVE_DURATION * len(segments.uncensored)) ** 2),
        )
        slope, curvature = fit_parameters(family, segments, theta, isinstance(previous, GaussianDurations))
        return GaussianDurations(1.0 - 0.5 * slope / curvature, np.sqrt(-0.5 / curvature))

    def parameter_count(self, states: int, max_duration: int) -> int:
        return 2 * states


@dataclass(frozen=True, slots=True)
class LogNormal:
    """LogNormalDurations, whose median is at one step or later."""

    label: str = "log-normal"

    def estimate(
        self, segments: Segments, previous: Durations | None, min_variance: float
    ) -> LogNormalDurations:
        """The floor is one for the variance about the mean length that was seen."""
        seen, variances = recorded_length_moments(segments)
        least = np.log1p(min_variance / seen**2)
        if isinstance(previous, LogNormalDurations):
            means, spreads = previous.log_means, previous.log_deviations**2
        else:
            spreads = np.clip(np.log1p(variances / seen**2), least, MAX_LOG_DEVIATION**2)
            means = np.log(seen)
        theta = np.stack([means / spreads, -0.5 / spreads])
        family = _bounded_family(
            lambda s: np.stack([np.log(s), np.log(s) ** 2], axis=1),
            lambda s: -np.log(s)[:, None],
            theta,
            (0.0, -0.5 / least),
            (np.inf, -0.5 / MAX_LOG_DEVIATION**2),
        )
        slope, curvature = fit_parameters(family, segments, theta, isinstance(previous, LogNormalDurations))
        return LogNormalDurations(-0.5 * slope / curvature, np.sqrt(-0.5 / curvature))

    def parameter_count(self, states: int, max_duration: int) -> int:
        return 2 * states


@dataclass(frozen=True, slots=True)
class Gamma:
    """GammaDurations."""

    label: str = "gamma"

    def estimate(self, segments: Segments, previous: Durations | None, min_variance: float) -> GammaDurations:
        """The floor is one for the variance about the mean length that was seen."""
        seen, variances = recorded_length_moments(segments)
        if isinstance(previous, GammaDurations):
            shapes, rates = previous.shapes, previous.rates
        else:
            rates = seen / np.maximum(variances, min_variance)
            shapes = seen * rates
        theta = np.stack([shapes - 1.0, -rates])
        family = _bounded_family(
            lambda s: np.stack([np.log(s), s], axis=1),
            _zero_log_base,
            theta,
            (-0.99, -seen / min_variance),
            (1e6, -1.0 / (MAX_RELATIVE_DURATION * len(segments.uncensored))),
        )
        more, negative_rates = fit_parameters(family, segments, theta, isinstance(previous, GammaDurations))
        return GammaDurations(1.0 + more, -negative_rates)

    def parameter_count(self, states: int, max_duration: int) -> int:
        return 2 * states


@dataclass(frozen=True, slots=True)
class Poisson:
    """PoissonDurations. Their variance follows their mean, so the floor does not bear on them."""

    label: str = "poisson"

    def estimate(
        self, segments: Segments, previous: Durations | None, min_variance: float
    ) -> PoissonDurations:
        from scipy.special import gammaln  # here: scipy doubles the time of importing pilotfish

        more = (
            previous.rates
            if isinstance(previous, PoissonDurations)
            else recorded_length_moments(segments)[0] - 1.0
        )
        most = MAX_RELATIVE_DURATION * len(segments.uncensored)
        theta = np.log(np.clip(more, MIN_RATE, most))[None]
        family = _bounded_family(
            lambda s: s[:, None] - 1.0,
            lambda s: -gammaln(s)[:, None],
            theta,
            (np.log(MIN_RATE),),
            (np.log(most),),
        )
        return PoissonDurations(
            np.exp(fit_parameters(family, segments, theta, isinstance(previous, PoissonDurations))[0])
        )

    def parameter_count(self, states: int, max_duration: int) -> int:
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

    def estimate(
        self, segments: Segments, previous: Durations | None, min_variance: float
    ) -> HistogramDurations:
        """The floor does not bear on it: free probabilities may say that every visit lasts alike.

        Visits whose ends were both seen need no rounds: their shares are the most likely law.
        Source: Vardi 1989, of lengths met at random, by alternating between them and the law.
        """
        S, K = segments.uncensored.shape
        if isinstance(previous, HistogramDurations):
            p = np.pad(previous.probabilities, ((0, max(0, S - len(previous.probabilities))), (0, 0)))
        else:
            p = np.full((S, K), 1.0 / S)
        steps = np.arange(1.0, len(p) + 1)[:, None]
        length_biased = (segments.left_censored + segments.doubly_censored).sum(axis=0)
        not_left_censored = (segments.uncensored + segments.right_censored).sum(axis=0) + self.pseudocount
        cut_off = (
            segments.right_censored.any() or segments.left_censored.any() or segments.doubly_censored.any()
        )
        for _ in range(MAX_ITERATIONS if cut_off else 1):
            counts = _complete_segments(p, segments) + self.pseudocount / len(p)
            likelier = _length_biased_probs(counts, not_left_censored, length_biased, steps)
            p = np.where(not_left_censored + length_biased > 0.0, likelier, p)
        return HistogramDurations(p)

    def parameter_count(self, states: int, max_duration: int) -> int:
        return states * (max_duration - 1)


def _complete_segments(p: Float[Array, "N K"], segments: Segments) -> Float[Array, "N K"]:
    """completed_visits, with the probabilities as they are where they are no smaller than that allows."""
    total = np.pad(segments.uncensored, ((0, len(p) - len(segments.uncensored)), (0, 0)))
    for counts, order in (
        (segments.right_censored + segments.left_censored, 1),
        (segments.doubly_censored, 2),
    ):
        if not counts.any():
            continue
        longer = p
        for _ in range(order):
            longer = longer[::-1].cumsum(axis=0)[::-1]
        known = longer[: len(counts)] >= MIN_TAIL_PROBABILITY
        if (~known & (counts > 1e-30 * counts.sum(axis=0))).any():
            with np.errstate(divide="ignore"):
                return complete_segments(np.log(p), segments)
        weights = np.zeros_like(p)
        np.divide(counts, longer[: len(counts)], out=weights[: len(counts)], where=known)
        for _ in range(order):
            weights = weights.cumsum(axis=0)
        total += p * weights
    return total


def _length_biased_probs(
    counts: Float[Array, "S K"],
    not_left_censored: Float[Array, " K"],
    length_biased: Float[Array, " K"],
    steps: Float[Array, "S 1"],
) -> Float[Array, "S K"]:
    """The p that maximises sum_s counts log p(s) - met log sum_s s p(s), where counts sum to fresh + met.

    It is counts / (fresh + met s / mean), its mean the only one at which this sums to one.
    """
    none = not_left_censored + length_biased <= 0.0
    if not length_biased.any():
        return np.asarray(counts / np.where(none, 1.0, not_left_censored))
    not_left_censored = np.where(none, 1.0, not_left_censored)
    low, high = np.ones_like(length_biased), np.full_like(length_biased, float(len(steps)))
    for _ in range(60):
        mean = np.sqrt(low * high)
        short = (counts / (not_left_censored + length_biased * steps / mean)).sum(axis=0) < 1.0
        low, high = np.where(short, mean, low), np.where(short, high, mean)
    p = counts / (not_left_censored + length_biased * steps / high)
    return np.asarray(p / np.where(none, 1.0, p.sum(axis=0)))


def _bounded_family(
    sufficient_statistics: Callable[[Float[Array, " S"]], Float[Array, "S Q"]],
    base: Callable[[Float[Array, " S"]], Float[Array, "S #K"]],
    start: Float[Array, "Q K"],
    lower: Sequence[float | Float[Array, " K"]],
    upper: Sequence[float],
) -> ExponentialFamily:
    """The family between these bounds, which give way to the start where it lies beyond them."""
    low, high = (
        np.stack([np.broadcast_to(one, start.shape[1:]) for one in bound]) for bound in (lower, upper)
    )
    return ExponentialFamily(sufficient_statistics, base, np.minimum(low, start), np.maximum(high, start))


def _zero_log_base(steps: Float[Array, " S"]) -> Float[Array, "S 1"]:
    return np.zeros((len(steps), 1))
