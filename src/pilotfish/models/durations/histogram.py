"""Non-parametric durations: a free probability for every length."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.models.durations.distribution import DurationDistribution
from pilotfish.models.durations.fit import complete_segments
from pilotfish.models.durations.quadrature import single_step_quadrature
from pilotfish.models.durations.segments import Segments
from pilotfish.models.durations.sums import log_reverse_cumsums, max_duration_from_probs
from pilotfish.types import Array, Float
from pilotfish.validation import MAX_MAGNITUDE, require_number, short_repr, shorten_repr

MIN_TAIL_PROBABILITY = 1e-250  # quotients by a survival probability above it do not overflow
MAX_ITERATIONS = 10  # of completing the censored segments
SUM_TOLERANCE = 1e-6  # of probabilities that sum to one


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Histogram(DurationDistribution):
    """Free probabilities of s = 1 .. S steps; longer segments are impossible.

    Attributes:
        probabilities: probabilities[s - 1, k] is the probability that state k lasts s steps.
    """

    name: ClassVar[str] = "histogram"
    options: ClassVar[Mapping[str, tuple[float, float]]] = {"pseudocount": (0.0, MAX_MAGNITUDE)}
    probabilities: Float[Array, "S K"]

    @classmethod
    def fit(
        cls,
        segments: Segments,
        previous: DurationDistribution | None = None,
        min_variance: float = 1.0,
        *,
        pseudocount: float = 0.0,
    ) -> "Histogram":
        """Estimate the probabilities from expected segments.

        Uncensored segments give their relative frequencies. Censored segments are distributed over the
        lengths that they may have, in turn with the probabilities (EM of Vardi 1989).

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration.
            min_variance: Not used: free probabilities may have any variance.
            pseudocount: Segments added to every state, spread evenly over all lengths; with 0 a length
                without segments is impossible.

        Returns:
            The maximum-likelihood distribution, after at most 10 iterations if segments are censored.

        Raises:
            InvalidInput: If pseudocount is negative.

        Source:
            Vardi 1989, Multiplicative censoring, renewal processes, deconvolution and decreasing density.
        """
        require_number(pseudocount, "pseudocount", *cls.options["pseudocount"])
        S, K = segments.uncensored.shape
        if isinstance(previous, Histogram):
            p = np.pad(previous.probabilities, ((0, max(0, S - len(previous.probabilities))), (0, 0)))
        else:
            p = np.full((S, K), 1.0 / S)
        steps = np.arange(1.0, len(p) + 1)[:, None]
        length_biased = (segments.left_censored + segments.doubly_censored).sum(axis=0)
        not_left_censored = (segments.uncensored + segments.right_censored).sum(axis=0) + pseudocount
        censored = (
            segments.right_censored.any() or segments.left_censored.any() or segments.doubly_censored.any()
        )
        for _ in range(MAX_ITERATIONS if censored else 1):
            counts = _complete_segments(p, segments) + pseudocount / len(p)
            new_p = _length_biased_probs(counts, not_left_censored, length_biased, steps)
            p = np.where(not_left_censored + length_biased > 0.0, new_p, p)
        return cls(p)

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        indices = np.minimum(steps, len(self.probabilities)).astype(np.int64) - 1
        impossible = (steps > len(self.probabilities))[:, None]
        with np.errstate(divide="ignore"):
            return np.where(impossible, -np.inf, np.log(self.probabilities[indices]))

    @property
    def means(self) -> Float[Array, " K"]:
        return np.asarray(np.arange(1.0, len(self.probabilities) + 1) @ self.probabilities)

    @property
    def deviations(self) -> Float[Array, " K"]:
        errors = np.arange(1.0, len(self.probabilities) + 1)[:, None] - self.means
        return np.asarray(np.sqrt((np.square(errors) * self.probabilities).sum(axis=0)))

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        return self.log_weights(np.arange(1.0, max_duration + 1.0))

    def log_survival(self, max_duration: int) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
        quadrature = single_step_quadrature(max(max_duration, len(self.probabilities)))
        log_p = self.log_table(quadrature.single_steps)
        return log_reverse_cumsums(log_p, quadrature, max_duration)

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_probs(self.probabilities, tail_probability)

    def degrees_of_freedom(self, states: Array, fixed_parameters: int = 0) -> int:
        positive = np.count_nonzero(self.probabilities[:, states], axis=0)
        return int(np.maximum(positive - 1, 0).sum())

    def validate(self) -> None:
        for k, column in enumerate(self.probabilities.T):
            with np.errstate(over="ignore"):
                total = float(column.sum())
            if (column < 0.0).any() or not abs(total - 1.0) <= SUM_TOLERANCE:
                raise InvalidInput(
                    f"durations.probabilities[:, {k}] is {short_repr(column.tolist())} with sum {total:.9g}, "
                    "expected probabilities of sum 1"
                )


def _complete_segments(p: Float[Array, "N K"], segments: Segments) -> Float[Array, "N K"]:
    """Distribute censored segments over their possible lengths; in logarithms only if a tail underflows."""
    total = np.pad(segments.uncensored, ((0, len(p) - len(segments.uncensored)), (0, 0)))
    for counts, order in (
        (segments.right_censored + segments.left_censored, 1),
        (segments.doubly_censored, 2),
    ):
        if not counts.any():
            continue
        survival = p
        for _ in range(order):
            survival = survival[::-1].cumsum(axis=0)[::-1]
        representable = survival[: len(counts)] >= MIN_TAIL_PROBABILITY
        if (~representable & (counts > 1e-30 * counts.sum(axis=0))).any():
            with np.errstate(divide="ignore"):
                return complete_segments(np.log(p), segments)
        weights = np.zeros_like(p)
        np.divide(counts, survival[: len(counts)], out=weights[: len(counts)], where=representable)
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
    """Maximise sum_s counts log p(s) - length_biased log sum_s s p(s) over p.

    The maximum is counts / (not_left_censored + length_biased s / mean); bisection finds the one mean at
    which it sums to one.
    """
    empty = not_left_censored + length_biased <= 0.0
    if not length_biased.any():
        return np.asarray(counts / np.where(empty, 1.0, not_left_censored))
    not_left_censored = np.where(empty, 1.0, not_left_censored)
    low, high = np.ones_like(length_biased), np.full_like(length_biased, float(len(steps)))
    for _ in range(60):
        mean = np.sqrt(low * high)
        too_small = (counts / (not_left_censored + length_biased * steps / mean)).sum(axis=0) < 1.0
        low, high = np.where(too_small, mean, low), np.where(too_small, high, mean)
    p = counts / (not_left_censored + length_biased * steps / high)
    return np.asarray(p / np.where(empty, 1.0, p.sum(axis=0)))
