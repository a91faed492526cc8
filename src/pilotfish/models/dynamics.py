"""How states follow one another: not at all, as a Markov chain, or as a semi-Markov chain with durations."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """No dynamics: every datapoint draws its state anew with these probabilities (a mixture)."""

    weights: Float[Array, " K"]


@dataclass(frozen=True, slots=True, eq=False)
class MarkovChain:
    """transitions[i, j] is the probability of state j one step after state i; rows sum to one."""

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]


@dataclass(frozen=True, slots=True, eq=False)
class GaussianDurations:
    """Steps spent in a state at one visit: N(mean, deviation^2), cut to whole steps s >= 1."""

    means: Float[Array, " K"]
    deviations: Float[Array, " K"]


@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovChain:
    """transitions[i, j] is the probability that a visit to j follows a visit to i.

    The diagonal is zero. A row of zeros is a final state: once there, the skill stays.
    """

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    durations: GaussianDurations


Dynamics = Weights | MarkovChain | SemiMarkovChain


def final_states(chain: SemiMarkovChain) -> Float[Array, " K"]:
    """One for states that are never left, zero for the others."""
    return np.asarray(~chain.transitions.any(axis=1), dtype=np.float64)


def longest_duration(durations: GaussianDurations) -> int:
    """The number of steps that a visit outlasts with probability below 2e-9, for means of a step or more."""
    return max(1, int(np.ceil((durations.means + 6.0 * durations.deviations).max())))


def log_duration_table(durations: GaussianDurations, longest: int) -> Float[Array, "S K"]:
    """table[s - 1, i] = log p(a visit to i lasts s steps), s = 1 ... longest, each column normalised.

    Normalising the cut Gaussian keeps every visit at least one step long; a mean far outside the range
    leaves all weight on the nearest length, never on none.
    """
    steps = np.arange(1, longest + 1)[:, None]
    log_p = -0.5 * ((steps - durations.means) / durations.deviations) ** 2
    return np.asarray(log_p - np.logaddexp.reduce(log_p, axis=0))
