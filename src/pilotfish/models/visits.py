"""Visits to states as recordings show them: whole, or cut off at either end."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from pilotfish import kernels
from pilotfish.models.durations import Durations, HistogramDurations
from pilotfish.models.durations_rule import step_by_step
from pilotfish.models.durations_sums import from_the_end, log_tails_of
from pilotfish.models.dynamics import Censoring, SemiMarkovChain, final_states
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import require_count

LONGEST = 2**31 - 1  # steps, of a visit or a plan that someone asks for
LOST = 1e-8  # a visit outlasts what is followed of it with less probability
ALL = 4  # where recordings are no longer than so many times that, visits are followed to their ends

Found = TypeVar("Found")


def require_longest(longest: int | None) -> None:
    """Raises: InvalidInput, unless it is a number of steps or None."""
    if longest is None:
        return
    require_count(longest, "longest", LONGEST, 1)


@dataclass(frozen=True, slots=True, eq=False)
class Visits:
    """Expected numbers of visits of s = 1 ... S recorded steps to each state. Adding is exact, in any order.

    whole      both ends were seen
    goes_on    cut off where the recording ends: it lasted s steps or more
    had_begun  cut off where the recording begins: s steps were left of it, or it began just then
    fills      cut off at both ends
    """

    whole: Float[Array, "S K"]
    goes_on: Float[Array, "S K"]
    had_begun: Float[Array, "S K"]
    fills: Float[Array, "S K"]

    def __add__(self, other: "Visits") -> "Visits":
        longest = max(len(self.whole), len(other.whole))
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Visits(*(_padded(a, longest) + _padded(b, longest) for a, b in pairs))


def _padded(counts: Float[Array, "S K"], longest: int) -> Float[Array, "L K"]:
    return np.pad(counts, ((0, longest - len(counts)), (0, 0)))


def whole_visits(counts: Float[Array, "S K"]) -> Visits:
    """Visits of which both ends were seen."""
    none = np.zeros_like(counts)
    return Visits(counts, none, none, none)


def of_states(visits: Visits, kept: Bool[Array, " K"]) -> Visits:
    return Visits(*(getattr(visits, f.name)[:, kept] for f in fields(visits)))


def log_tails(durations: Durations, longest: int) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
    """log p(a visit lasts d steps or more), and log of that summed over d and all above; d = 1 ... longest.

    The second at d = 1 is the mean duration. Both stay exact where they are far below the smallest number.
    """
    if not isinstance(durations, HistogramDurations):
        return log_tails_of(durations.log_weights, longest)
    rule = step_by_step(max(longest, len(durations.probabilities)))
    log_p = durations.log_table(rule.whole)
    return from_the_end(log_p, rule, longest), from_the_end(log_p, rule, longest, order=2)


def visit_tables(chain: SemiMarkovChain, longest: int) -> kernels.SemiMarkovTables:
    """How probable visits of up to longest steps are, of every kind that its censoring lets a recording show.

    A visit that had begun was met at a random one of its steps: of r steps left with probability
    p(duration >= r) / mean duration. Visits to final states never end, however long.
    """
    log_p = chain.durations.log_table(longest)
    log_longer, log_excess = log_tails(chain.durations, longest)
    log_left, log_both = log_longer - log_excess[0], log_excess - log_excess[0]
    first, last, final = chain.censoring.first, chain.censoring.last, final_states(chain)
    inside = np.where(final, -np.inf, log_p)
    begun = np.where(final, -np.inf, log_left) if first else inside
    ending = np.where(final, 0.0, log_longer) if last else log_p
    only = np.where(final, 0.0, log_both) if first and last else log_left if first else ending
    beyond = np.where(final & last, 0.0, -np.inf)
    return kernels.SemiMarkovTables(
        chain.initial,
        chain.transitions,
        np.stack([inside, begun, ending, only]),
        np.stack([beyond, beyond]),
    )


def followed_far_enough(
    durations: Durations,
    steps: int,
    follow: Callable[[int], Found],
    log_p: Callable[[Found], Float[Array, "*n"]],
) -> Found:
    """What follow(longest) finds once visits of more than longest recorded steps matter no more.

    Beginning with what a visit outlasts with a probability of 1e-8, twice as far each time, until nothing of
    log_p gains more than 1e-8 nats a step by that; or as far as the recording goes. Recordings not much
    longer than visits are followed to the end at once. So where data hold a visit far beyond what its law
    expects, or are impossible without it, it is found.
    """
    longest = durations.longest(LOST)
    if steps <= ALL * longest:
        return follow(steps)
    found = follow(longest)
    while longest < steps:
        longest = min(2 * longest, steps)
        before, found = log_p(found), follow(longest)
        with np.errstate(invalid="ignore"):
            if (log_p(found) - before <= LOST * steps).all():  # impossible before and after is no gain: NaN
                break
    return found


def visits_of(counts: Float[Array, "4 S K"], chain: SemiMarkovChain) -> Visits:
    """What the kernel counted, by what it says about durations; of final states nothing is said."""
    inside, begun, ending, only = counts
    none = np.zeros_like(inside)
    match chain.censoring:
        case Censoring(first=False, last=False):
            return whole_visits(inside + begun + ending + only)
        case Censoring(first=False, last=True):
            seen = Visits(inside + begun, ending + only, none, none)
        case Censoring(first=True, last=False):
            return Visits(inside + ending, none, begun + only, none)
        case _:
            seen = Visits(inside, ending, begun, only)
    lost = ~final_states(chain)
    return replace(seen, goes_on=seen.goes_on * lost, fills=seen.fills * lost)


def lengths_seen(visits: Visits) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Mean and variance of the recorded lengths, cut off or not; of all states where one has no visits."""
    counts = visits.whole + visits.goes_on + visits.had_begun + visits.fills
    pooled = counts.sum(axis=1, keepdims=True)
    if not pooled.any():
        pooled = np.ones_like(pooled)
    counts = np.where(counts.sum(axis=0) > 0.0, counts, pooled)
    p = counts / counts.sum(axis=0)
    steps = np.arange(1.0, len(p) + 1)
    means = steps @ p
    return means, (np.square(steps[:, None] - means) * p).sum(axis=0)
