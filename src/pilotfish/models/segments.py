"""Visits to states as recordings show them: whole, or cut off at either end."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from pilotfish import kernels
from pilotfish.models.durations.quadrature import single_step_quadrature
from pilotfish.models.durations.sums import log_reverse_cumsum, log_survival_from_weights
from pilotfish.models.durations.values import Durations, HistogramDurations
from pilotfish.models.dynamics import Censoring, SemiMarkovChain, final_states
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import require_count

MAX_DURATION = 2**31 - 1  # steps, of a visit or a plan that someone asks for
TAIL_PROBABILITY = 1e-8  # a visit outlasts what is followed of it with less probability
FULL_LENGTH_FACTOR = (
    4  # where recordings are no longer than so many times that, visits are followed to their ends
)

Result = TypeVar("Result")


def validate_max_duration(max_duration: int | None) -> None:
    """Raises: InvalidInput, unless it is a number of steps or None."""
    if max_duration is None:
        return
    require_count(max_duration, "max_duration", MAX_DURATION, 1)


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Expected numbers of visits of s = 1 ... S recorded steps to each state. Adding is exact, in any order.

    whole      both ends were seen
    goes_on    cut off where the recording ends: it lasted s steps or more
    had_begun  cut off where the recording begins: s steps were left of it, or it began just then
    fills      cut off at both ends
    """

    uncensored: Float[Array, "S K"]
    right_censored: Float[Array, "S K"]
    left_censored: Float[Array, "S K"]
    doubly_censored: Float[Array, "S K"]

    def __add__(self, other: "Segments") -> "Segments":
        max_duration = max(len(self.uncensored), len(other.uncensored))
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Segments(
            *(_pad_durations(a, max_duration) + _pad_durations(b, max_duration) for a, b in pairs)
        )


def _pad_durations(counts: Float[Array, "S K"], max_duration: int) -> Float[Array, "L K"]:
    return np.pad(counts, ((0, max_duration - len(counts)), (0, 0)))


def uncensored_segments(counts: Float[Array, "S K"]) -> Segments:
    """Visits of which both ends were seen."""
    zeros = np.zeros_like(counts)
    return Segments(counts, zeros, zeros, zeros)


def select_states(segments: Segments, kept: Bool[Array, " K"]) -> Segments:
    return Segments(*(getattr(segments, f.name)[:, kept] for f in fields(segments)))


def log_survival(durations: Durations, max_duration: int) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
    """Log p(a visit lasts d steps or more), and log of that summed over d and all above; d = 1 ... longest.

    The second at d = 1 is the mean duration. Both stay exact where they are far below the smallest number.
    """
    if not isinstance(durations, HistogramDurations):
        return log_survival_from_weights(durations.log_weights, max_duration)
    quadrature = single_step_quadrature(max(max_duration, len(durations.probabilities)))
    log_p = durations.log_table(quadrature.single_steps)
    return log_reverse_cumsum(log_p, quadrature, max_duration), log_reverse_cumsum(
        log_p, quadrature, max_duration, order=2
    )


def segment_tables(chain: SemiMarkovChain, max_duration: int) -> kernels.SemiMarkovTables:
    """How probable visits of up to longest steps are, of every kind that its censoring lets a recording show.

    A visit that had begun was met at a random one of its steps: of r steps left with probability
    p(duration >= r) / mean duration. Visits to final states never end, however long.
    """
    log_p = chain.durations.log_table(max_duration)
    log_tail, log_tail_sum = log_survival(chain.durations, max_duration)
    log_residual, log_residual_tail = log_tail - log_tail_sum[0], log_tail_sum - log_tail_sum[0]
    left, right, final = chain.censoring.left, chain.censoring.right, final_states(chain)
    log_uncensored = np.where(final, -np.inf, log_p)
    log_left_censored = np.where(final, -np.inf, log_residual) if left else log_uncensored
    log_right_censored = np.where(final, 0.0, log_tail) if right else log_p
    log_doubly_censored = (
        np.where(final, 0.0, log_residual_tail)
        if left and right
        else log_residual
        if left
        else log_right_censored
    )
    log_beyond = np.where(final & right, 0.0, -np.inf)
    return kernels.SemiMarkovTables(
        chain.initial,
        chain.transitions,
        np.stack([log_uncensored, log_left_censored, log_right_censored, log_doubly_censored]),
        np.stack([log_beyond, log_beyond]),
    )


def extend_max_duration(
    durations: Durations,
    steps: int,
    compute: Callable[[int], Result],
    log_p: Callable[[Result], Float[Array, "*n"]],
) -> Result:
    """What follow(longest) finds once visits of more than longest recorded steps matter no more.

    Beginning with what a visit outlasts with a probability of 1e-8, twice as far each time, until nothing of
    log_p gains more than 1e-8 nats a step by that; or as far as the recording goes. Recordings not much
    longer than visits are followed to the end at once. So where data hold a visit far beyond what its law
    expects, or are impossible without it, it is found.
    """
    max_duration = durations.max_duration(TAIL_PROBABILITY)
    if steps <= FULL_LENGTH_FACTOR * max_duration:
        return compute(steps)
    result = compute(max_duration)
    while max_duration < steps:
        max_duration = min(2 * max_duration, steps)
        before, result = log_p(result), compute(max_duration)
        with np.errstate(invalid="ignore"):
            if (
                log_p(result) - before <= TAIL_PROBABILITY * steps
            ).all():  # impossible before and after is no gain: NaN
                break
    return result


def segments_from_counts(counts: Float[Array, "4 S K"], chain: SemiMarkovChain) -> Segments:
    """What the kernel counted, by what it says about durations; of final states nothing is said."""
    log_uncensored, log_left_censored, log_right_censored, log_doubly_censored = counts
    zeros = np.zeros_like(log_uncensored)
    match chain.censoring:
        case Censoring(left=False, right=False):
            return uncensored_segments(
                log_uncensored + log_left_censored + log_right_censored + log_doubly_censored
            )
        case Censoring(left=False, right=True):
            counted = Segments(
                log_uncensored + log_left_censored, log_right_censored + log_doubly_censored, zeros, zeros
            )
        case Censoring(left=True, right=False):
            return Segments(
                log_uncensored + log_right_censored, zeros, log_left_censored + log_doubly_censored, zeros
            )
        case _:
            counted = Segments(log_uncensored, log_right_censored, log_left_censored, log_doubly_censored)
    not_final = ~final_states(chain)
    return replace(
        counted,
        right_censored=counted.right_censored * not_final,
        doubly_censored=counted.doubly_censored * not_final,
    )


def recorded_length_moments(segments: Segments) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Mean and variance of the recorded lengths, cut off or not; of all states where one has no visits."""
    counts = segments.uncensored + segments.right_censored + segments.left_censored + segments.doubly_censored
    pooled = counts.sum(axis=1, keepdims=True)
    if not pooled.any():
        pooled = np.ones_like(pooled)
    counts = np.where(counts.sum(axis=0) > 0.0, counts, pooled)
    p = counts / counts.sum(axis=0)
    steps = np.arange(1.0, len(p) + 1)
    means = steps @ p
    return means, (np.square(steps[:, None] - means) * p).sum(axis=0)
