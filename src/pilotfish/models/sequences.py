"""State sequences of a skill: the most probable at each time, random ones, and the one that explains data."""

from collections.abc import Sequence

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.gaussians import whiteners
from pilotfish.models.dynamics import Dynamics, MarkovChain, SemiMarkovChain, Weights
from pilotfish.models.forward import LONGEST_PLAN, occupancy
from pilotfish.models.skill import AdaptedSkill, HiddenModel, Skill
from pilotfish.models.statistics import one_step_chain
from pilotfish.models.visits import followed_far_enough, log_tails, require_longest, visit_tables
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count

UNLIKELY = 1e-12  # probability of a visit longer than what is sampled


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
    """The single most likely state sequence of a demonstration; of a semi-Markov skill, of its visits.

    Visits are followed until to follow them twice as far finds nothing likelier by 1e-8 nats a step.
    Cost: O(T K (K + L)), L the longest visit of a semi-Markov skill that is followed.
    """
    emissions = log_emissions(model, agreeing_views(model, [demonstration]))
    if isinstance(chain := model.dynamics, SemiMarkovChain):
        return followed_far_enough(
            chain.durations,
            len(emissions),
            lambda longest: kernels.semi_markov_viterbi(emissions, visit_tables(chain, longest)),
            lambda path: np.array(path.log_probability),
        ).states
    return kernels.viterbi(emissions, *one_step_chain(model.dynamics)).states


def agreeing_views(model: HiddenModel | Skill, demonstrations: Sequence[Demonstration]) -> Views:
    """What the model's frames see.    Raises: InvalidInput, when they or the columns are not the model's."""
    require_kind("model", model, (HiddenModel, Skill), "a fit holds a skill: fit.skill")
    data = views(demonstrations)
    if (seen := (data.x.shape[0], data.x.shape[2])) != (
        known := (model.means.shape[0], model.means.shape[2])
    ):
        raise InvalidInput(
            f"the demonstrations have {seen[0]} frames of {seen[1]} columns, the model knows {known[0]} of "
            f"{known[1]}; give those that it was learned from, or others of their kind"
        )
    return data


def log_likelihood(
    model: HiddenModel | Skill, demonstrations: Sequence[Demonstration], *, longest: int | None = None
) -> Float[Array, " M"]:
    """log p(demonstration) under the model [nats], for each of them: over all state sequences, in all frames.

    Densities are those of the rows as every frame sees them, multiplied. Visits of a semi-Markov skill are
    followed up to longest steps; where that is not given, until to follow them twice as far adds no more than
    1e-8 nats a step. Cost: O(T K (K + L)), L the longest visit that is followed.
    """
    require_longest(longest)
    data = agreeing_views(model, demonstrations)
    parts = np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])
    if isinstance(model.dynamics, SemiMarkovChain):
        return np.array([_log_likelihood(model.dynamics, part, longest) for part in parts])
    chain = one_step_chain(model.dynamics)
    return np.array([kernels.forward_backward(part, *chain).log_likelihood for part in parts])


def _log_likelihood(chain: SemiMarkovChain, emissions: Float[Array, "T K"], longest: int | None) -> float:
    def follow(longest: int) -> float:
        return kernels.semi_markov(emissions, visit_tables(chain, longest)).log_likelihood

    if longest is not None:
        return follow(min(longest, len(emissions)))
    return float(followed_far_enough(chain.durations, len(emissions), follow, np.array))


def sample_states(dynamics: Dynamics, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
    """A random state sequence: several ways through a movement appear with their probabilities.

    Every visit lasts at least one step; a final state lasts to the end.
    """
    require_count(horizon, "horizon", LONGEST_PLAN, 1)
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
    longest = min(chain.durations.longest(UNLIKELY), horizon)
    table = np.exp(chain.durations.log_table(longest))  # (S, K)
    table[-1] = (1.0 - table[:-1].sum(axis=0)).clip(min=0.0)  # visits that go on beyond it
    state = int(rng.choice(len(chain.initial), p=chain.initial))
    lengths = _lengths_left(chain, longest) if chain.censoring.first else table
    states: list[int] = []
    while len(states) < horizon:
        onward = chain.transitions[state]
        if not onward.any():
            return np.array(states + [state] * (horizon - len(states)))
        odds = lengths[:, state] / lengths[:, state].sum()
        states += [state] * int(rng.choice(len(odds), p=odds) + 1)
        state, lengths = int(rng.choice(len(onward), p=onward)), table
    return np.array(states[:horizon])


def _lengths_left(chain: SemiMarkovChain, longest: int) -> Float[Array, "S K"]:
    """p(s steps are left of a visit that is met at a random one of its steps), up to a factor."""
    log_longer, log_excess = log_tails(chain.durations, longest)
    return np.asarray(np.exp(np.concatenate([log_longer[:-1], log_excess[-1:]])))
