"""State sequences of recordings: emission densities, Viterbi paths and log-likelihoods of a skill."""

from collections.abc import Sequence

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput
from pilotfish.models.duration_model import validate_max_duration
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type


def log_emissions(model: HiddenModel | Skill, data: Views) -> Float[Array, "N K"]:
    """Compute the log-density of every datapoint in every state, multiplied over the frames.

    Args:
        model: A model or skill with the frames of the data.
        data: Demonstrations as every frame sees them.

    Returns:
        log b_k(x_n) of all demonstrations, one after another.

    Raises:
        NotPositiveDefinite: If a covariance of the model is not positive definite.
    """
    W = np.stack([c.precision_cholesky("the covariance of state") for c in model.covariances])
    return kernels.log_emissions(data.x, kernels.Emissions(model.means, W, data.orientation_starts))


def viterbi(model: HiddenModel | Skill, demonstration: Demonstration) -> Int[Array, " T"]:
    """Compute the most probable state sequence of a demonstration (Viterbi algorithm).

    Of a semi-Markov skill this is the most probable segmentation. Cost: O(T K^2), or O(T K (K + L)) for
    segments of up to L steps.

    Args:
        model: A model or skill with the frames of the demonstration.
        demonstration: The recording.

    Raises:
        InvalidInput: If frames or columns are not those of the model.
    """
    return model.dynamics.viterbi(log_emissions(model, validated_views(model, [demonstration])))


def log_likelihood(
    model: HiddenModel | Skill, demonstrations: Sequence[Demonstration], *, max_duration: int | None = None
) -> Float[Array, " M"]:
    """Compute log p(demonstration) of each demonstration, summed over all state sequences [nats].

    The densities of all frames are multiplied, so values compare only between models with the same frames,
    columns and units. Cost: O(T K^2), or O(T K (K + L)) for segments of up to L steps.

    Args:
        model: A model or skill with the frames of the demonstrations.
        demonstrations: The recordings.
        max_duration: Longest segment of a semi-Markov model [steps]. By default it is doubled until the
            result changes by less than 1e-8 nats per step.

    Raises:
        InvalidInput: If frames or columns are not those of the model.
    """
    validate_max_duration(max_duration)
    data = validated_views(model, demonstrations)
    parts = np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])
    return np.array([model.dynamics.log_likelihood(part, max_duration) for part in parts])


def validated_views(model: HiddenModel | Skill, demonstrations: Sequence[Demonstration]) -> Views:
    """Return the demonstrations as every frame sees them; raise InvalidInput if they do not fit the model."""
    require_type(model, "model", (HiddenModel, Skill), "a fit holds a skill: fit.skill")
    data = views(demonstrations)
    given, expected = (data.x.shape[0], data.x.shape[2]), (model.means.shape[0], model.means.shape[2])
    if given != expected:
        raise InvalidInput(
            f"the demonstrations have {given[0]} frames of {given[1]} columns, expected {expected[0]} of "
            f"{expected[1]}; pass demonstrations like those that the model was learned from"
        )
    return data


def state_segments(states: Int[Array, " T"]) -> tuple[Int[Array, " R"], Int[Array, " R"]]:
    """Split a state sequence into segments, maximal runs of one state.

    Args:
        states: State of every step.

    Returns:
        The state and the length [steps] of every segment, in order.
    """
    starts = np.concatenate([[0], np.flatnonzero(np.diff(states)) + 1])
    return states[starts], np.diff(np.append(starts, len(states)))
