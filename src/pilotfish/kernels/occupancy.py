"""Filter of the state that an operator is in, and of the time already spent there.

The belief b(d, k) is the probability of state k, entered d steps ago, given all commands so far. With the
duration distribution p_k and its survival function S_k, a segment of age d ends with the hazard
p_k(d) / S_k(d):

    b'(d + 1, k) = (1 - hazard_k(d)) b(d, k)                               the segment continues
    b'(1, j)     = sum over k, d of hazard_k(d) b(d, k) a_kj               the next one begins
    b(d, k)      proportional to b'(d, k) N(log_mu_k(x); 0, Sigma_k + S)   the command x is observed

This is the forward variable of the semi-Markov chain with the time spent in the state written out. The
initial probabilities are used at the first step only: a left-right skill does not return to its first state.
A final state has hazard 0. A Markov chain has one age, and a mixture forgets its state at every step.

A running filter observes a command once per period of the skill, however often it is called. In between, its
probabilities are interpolated.

Invariants. The belief sums to one. `StateFilter` with a step of one period equals predict, then observe.
"""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

ROUNDING = 1e-9  # of a period
MAX_STEPS = 100  # periods in one step of time; more are as good as infinitely many


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class OccupancyTables:
    """Probabilities of one step of the filter.

    Attributes:
        initial: Probability of each state at the first step.
        transitions: Probability that state j follows state i at the end of a segment.
        hazards: Probability that a segment of age d = 1 .. L ends.
        reset: Probability that the state is drawn again.
    """

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    hazards: Float[Array, "L K"]
    reset: float


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class StateFilter:
    """Belief about the state, and its last two observations.

    Attributes:
        belief: Probability of each age and state.
        before: Probability of each state one observation ago.
        now: Probability of each state at the last observation.
        elapsed: Time since the last observation [s]; infinite before the first.
    """

    belief: Float[Array, "L K"]
    before: Float[Array, " K"]
    now: Float[Array, " K"]
    elapsed: float

    def probabilities(self, period: float, dt: float) -> Float[Array, " K"]:
        """Return the probability of each state, interpolated over a period.

        Args:
            period: Period of the skill [s].
            dt: Time of a step [s]; steps of a period or more take the last observation.
        """
        s = min(1.0, (self.elapsed + dt) / period)
        return (1.0 - s) * self.before + s * self.now


def predict_belief(tables: OccupancyTables, belief: Float[Array, "L K"]) -> Float[Array, "L K"]:
    """Return the belief one step later, before the next command.

    Args:
        tables: Tables of the skill.
        belief: Probability of each age and state.
    """
    leaving = tables.hazards * belief
    staying = belief - leaving
    later = np.empty_like(belief)
    later[0] = leaving.sum(axis=0) @ tables.transitions
    later[1:] = staying[:-1]
    later[-1] += staying[-1]  # the last age stands for all longer ones
    later *= 1.0 - tables.reset
    later[0] += tables.reset / belief.shape[1]
    return later


def observe_command(belief: Float[Array, "L K"], log_likelihoods: Float[Array, " K"]) -> Float[Array, "L K"]:
    """Return the belief given a command (Bayes' rule).

    Args:
        belief: Probability of each age and state before the command.
        log_likelihoods: Log-density of the command in each state, finite.
    """
    occupied = belief.sum(axis=0)
    with np.errstate(divide="ignore"):
        log_posterior = np.log(occupied) + log_likelihoods
    probs = np.exp(log_posterior - np.logaddexp.reduce(log_posterior))
    ages = np.divide(belief, occupied, out=np.zeros_like(belief), where=occupied > 0.0)
    return np.asarray(ages * (probs / probs.sum()))


def advance_filter(
    tables: OccupancyTables,
    before: StateFilter,
    log_likelihoods: Float[Array, " K"],
    period: float,
    dt: float,
) -> StateFilter:
    """Return the filter after a step of time; a command is observed once per period of the skill.

    Args:
        tables: Tables of the skill.
        before: Filter before the step.
        log_likelihoods: Log-density of the command in each state.
        period: Period of the skill [s].
        dt: Time of the step [s].
    """
    is_first, elapsed = before.elapsed == np.inf, before.elapsed + dt
    if elapsed < (1.0 - ROUNDING) * period:
        return replace(before, elapsed=elapsed)
    steps = 0 if is_first else int(min(elapsed / period + ROUNDING, MAX_STEPS))
    belief = before.belief
    for _ in range(steps):
        belief = predict_belief(tables, belief)
    belief = observe_command(belief, log_likelihoods)
    now = belief.sum(axis=0)
    remainder = 0.0 if is_first else max(0.0, elapsed - steps * period)
    return StateFilter(belief, now if is_first else before.now, now, remainder)
