"""State sequences of a skill: the most probable at each time, random ones, and the one that explains data."""

from collections.abc import Sequence

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import precision_cholesky
from pilotfish.models.dynamics import Dynamics, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.forward import MAX_HORIZON, filtered_state_probs
from pilotfish.models.segments import extend_max_duration, log_survival, segment_tables, validate_max_duration
from pilotfish.models.skill import AdaptedSkill, HiddenModel, Skill
from pilotfish.models.statistics import step_probabilities
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count, require_type

TAIL_PROBABILITY = 1e-12  # probability of a visit longer than what is sampled


def log_emissions(model: HiddenModel | Skill, data: Views) -> Float[Array, "N K"]:
    """Log p(x_n | state i), frames multiplied together, of every datapoint of every demonstration."""
    W = np.stack([c.precision_cholesky("the covariance of state") for c in model.covariances])
    return kernels.log_emissions(data.x, kernels.Emissions(model.means, W, data.orientation_starts))


def log_state_likelihoods(model: AdaptedSkill, x: Float[Array, "T D"]) -> Float[Array, "T K"]:
    """Log p(x_t | state i) of an adapted skill, for points in the world."""
    W = precision_cholesky(model.covariances, "the adapted covariance of state")
    return kernels.log_emissions(
        x[None], kernels.Emissions(model.means[None], W[None], model.layout.orientation_starts)
    )


def most_probable_states(
    dynamics: Dynamics, log_observed: Float[Array, "S K"], horizon: int
) -> Int[Array, " T"]:
    """The state of largest occupancy at every step (3.42): a deterministic, step-wise plan."""
    return np.asarray(filtered_state_probs(dynamics, log_observed, horizon).argmax(axis=1))


def viterbi(model: HiddenModel | Skill, demonstration: Demonstration) -> Int[Array, " T"]:
    """The single most likely state sequence of a demonstration; of a semi-Markov skill, of its visits.

    Visits are followed until to follow them twice as far finds nothing likelier by 1e-8 nats a step.
    Cost: O(T K (K + L)), L the longest visit of a semi-Markov skill that is followed.
    """
    emissions = log_emissions(model, validated_views(model, [demonstration]))
    if isinstance(chain := model.dynamics, SemiMarkovChain):
        return extend_max_duration(
            chain.durations,
            len(emissions),
            lambda max_duration: kernels.semi_markov_viterbi(emissions, segment_tables(chain, max_duration)),
            lambda path: np.array(path.log_probability),
        ).states
    return kernels.viterbi(emissions, *step_probabilities(model.dynamics)).states


def validated_views(model: HiddenModel | Skill, demonstrations: Sequence[Demonstration]) -> Views:
    """What the model's frames see.    Raises: InvalidInput, when they or the columns are not the model's."""
    require_type(model, "model", (HiddenModel, Skill), "a fit holds a skill: fit.skill")
    data = views(demonstrations)
    if (given_shape := (data.x.shape[0], data.x.shape[2])) != (
        expected_shape := (model.means.shape[0], model.means.shape[2])
    ):
        raise InvalidInput(
            f"the demonstrations have {given_shape[0]} frames of {given_shape[1]} columns, the model knows {expected_shape[0]} of "
            f"{expected_shape[1]}; give those that it was learned from, or others of their kind"
        )
    return data


def log_likelihood(
    model: HiddenModel | Skill, demonstrations: Sequence[Demonstration], *, max_duration: int | None = None
) -> Float[Array, " M"]:
    """Log p(demonstration) under the model [nats], for each of them: over all state sequences, in all frames.

    Densities are those of the rows as every frame sees them, multiplied. Visits of a semi-Markov skill are
    followed up to longest steps; where that is not given, until to follow them twice as far adds no more than
    1e-8 nats a step. Cost: O(T K (K + L)), L the longest visit that is followed.
    """
    validate_max_duration(max_duration)
    data = validated_views(model, demonstrations)
    parts = np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])
    if isinstance(model.dynamics, SemiMarkovChain):
        return np.array([_log_likelihood(model.dynamics, part, max_duration) for part in parts])
    chain = step_probabilities(model.dynamics)
    return np.array([kernels.forward_backward(part, *chain).log_likelihood for part in parts])


def _log_likelihood(
    chain: SemiMarkovChain, emissions: Float[Array, "T K"], max_duration: int | None
) -> float:
    def compute(max_duration: int) -> float:
        return kernels.semi_markov(emissions, segment_tables(chain, max_duration)).log_likelihood

    if max_duration is not None:
        return compute(min(max_duration, len(emissions)))
    return float(extend_max_duration(chain.durations, len(emissions), compute, np.array))


def sample_states(dynamics: Dynamics, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
    """A random state sequence: several ways through a movement appear with their probabilities.

    Every visit lasts at least one step; a final state lasts to the end.
    """
    require_count(horizon, "horizon", MAX_HORIZON, 1)
    if isinstance(dynamics, MixtureWeights):
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
    max_duration = min(chain.durations.max_duration(TAIL_PROBABILITY), horizon)
    table = np.exp(chain.durations.log_table(max_duration))  # (S, K)
    table[-1] = (1.0 - table[:-1].sum(axis=0)).clip(min=0.0)  # visits that go on beyond it
    state = int(rng.choice(len(chain.initial), p=chain.initial))
    lengths = _remaining_durations(chain, max_duration) if chain.censoring.left else table
    states: list[int] = []
    while len(states) < horizon:
        next_probs = chain.transitions[state]
        if not next_probs.any():
            return np.array(states + [state] * (horizon - len(states)))
        duration_probs = lengths[:, state] / lengths[:, state].sum()
        states += [state] * int(rng.choice(len(duration_probs), p=duration_probs) + 1)
        state, lengths = int(rng.choice(len(next_probs), p=next_probs)), table
    return np.array(states[:horizon])


def _remaining_durations(chain: SemiMarkovChain, max_duration: int) -> Float[Array, "S K"]:
    """p(s steps are left of a visit that is met at a random one of its steps), up to a factor."""
    log_tail, log_tail_sum = log_survival(chain.durations, max_duration)
    return np.asarray(np.exp(np.concatenate([log_tail[:-1], log_tail_sum[-1:]])))
