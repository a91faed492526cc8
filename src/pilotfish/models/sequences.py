"""State sequences of a skill: the most probable at each time, random ones, and the one that explains data."""

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import whiteners
from pilotfish.models.dynamics import (
    Dynamics,
    MarkovChain,
    SemiMarkovChain,
    Weights,
    log_duration_table,
    longest_duration,
)
from pilotfish.models.forward import occupancy
from pilotfish.models.skill import AdaptedSkill, HiddenModel, Skill
from pilotfish.models.statistics import one_step_chain
from pilotfish.types import Array, Float, Int


def log_emissions(model: HiddenModel | Skill, data: Views) -> Float[Array, "N K"]:
    """log p(x_n | state i), frames multiplied together, of every datapoint of every demonstration."""
    W = np.stack([c.whiteners("the covariance of state") for c in model.covariances])
    return kernels.log_emissions(data.x, kernels.Emissions(model.means, W, data.turns))


def log_likelihood_of_states(model: AdaptedSkill, x: Float[Array, "T D"]) -> Float[Array, "T K"]:
    """log p(x_t | state i) of an adapted skill, for points in the world."""
    W = whiteners(model.covariances, "the adapted covariance of state")
    return kernels.log_emissions(x[None], kernels.Emissions(model.means[None], W[None], model.layout.turns))


def most_probable_states(
    dynamics: Dynamics, log_observed: Float[Array, "S K"], horizon: int
) -> Int[Array, " T"]:
    """The state of largest occupancy at every step (3.42): a deterministic, step-wise plan."""
    return np.asarray(occupancy(dynamics, log_observed, horizon).argmax(axis=1))


def viterbi(model: HiddenModel | Skill, demonstration: Demonstration) -> Int[Array, " T"]:
    """The single most likely state sequence of a demonstration under a mixture or Markov skill.

    Raises: InvalidInput for a semi-Markov skill, whose Markov form is fit.markov.
    """
    initial, transitions = one_step_chain(model.dynamics)
    return kernels.viterbi(log_emissions(model, views([demonstration])), initial, transitions).states


def sample_states(dynamics: Dynamics, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
    """A random state sequence: several ways through a movement appear with their probabilities.

    Every visit lasts at least one step; a final state lasts to the end.
    """
    if horizon < 1:
        raise InvalidInput(f"horizon is {horizon} steps, expected at least 1")
    if isinstance(dynamics, Weights):
        return rng.choice(len(dynamics.weights), size=horizon, p=dynamics.weights)
    if isinstance(dynamics, MarkovChain):
        return _sample_markov(dynamics, horizon, rng)
    return _sample_semi_markov(dynamics, horizon, rng)


def _sample_markov(chain: MarkovChain, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
    K = len(chain.initial)
    states = [rng.choice(K, p=chain.initial)]
    while len(states) < horizon:
        states.append(rng.choice(K, p=chain.transitions[states[-1]]))
    return np.array(states)


def _sample_semi_markov(chain: SemiMarkovChain, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
    K, longest = len(chain.initial), longest_duration(chain.durations)
    table = np.exp(log_duration_table(chain.durations, longest))  # (S, K)
    state = rng.choice(K, p=chain.initial)
    states: list[int] = []
    while len(states) < horizon:
        onward = chain.transitions[state]
        if not onward.any():
            return np.array(states + [state] * (horizon - len(states)))
        states += [state] * int(rng.choice(longest, p=table[:, state]) + 1)
        state = rng.choice(K, p=onward)
    return np.array(states[:horizon])
