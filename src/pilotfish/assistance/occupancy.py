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

Two deviations from the learned chain keep the filter right for a person who is slower, pauses, or goes back:
the hazard is at most MAX_HAZARD, and at every step the state is drawn again with the probability RESET.

Invariants. The belief sums to one. With MAX_HAZARD = 1 and RESET = 0, its sum over d equals
`SemiMarkovChain.filtered_state_probs`.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish.models import Dynamics, SemiMarkovChain
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MAX_HAZARD = 0.5  # per step
RESET = 1e-4  # per step
TAIL_PROBABILITY = 1e-8  # of segments longer than the ages that are distinguished
MAX_AGES = 2000  # steps


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


def occupancy_tables(
    dynamics: Dynamics, *, max_hazard: float = MAX_HAZARD, reset: float = RESET
) -> OccupancyTables:
    """Return the tables of the filter for the dynamics of a skill.

    Args:
        dynamics: Mixture, Markov or semi-Markov dynamics.
        max_hazard: Largest probability that a segment ends at a step.
        reset: Probability per step that the state is drawn again.
    """
    if isinstance(dynamics, SemiMarkovChain):
        limit = min(dynamics.durations.max_duration(TAIL_PROBABILITY), MAX_AGES)
        log_survival = dynamics.durations.log_survival(limit)[0]
        hazards = np.exp(np.minimum(dynamics.durations.log_table(limit) - log_survival, 0.0))
        hazards = np.where(dynamics.final_states(), 0.0, np.minimum(hazards, max_hazard))
        return OccupancyTables(dynamics.initial, dynamics.transitions, hazards, reset)
    _, steps = dynamics.step_probabilities()
    return OccupancyTables(dynamics.initial, steps, np.ones((1, len(steps))), reset)


def initial_belief(tables: OccupancyTables) -> Float[Array, "L K"]:
    """Return the belief before the first command: every state at age one with its initial probability.

    Args:
        tables: Tables of the skill.
    """
    belief = np.zeros_like(tables.hazards)
    belief[0] = (1.0 - tables.reset) * tables.initial + tables.reset / len(tables.initial)
    return belief


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
