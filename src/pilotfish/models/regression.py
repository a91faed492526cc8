"""Regression with a skill: some columns of its states given the others, with or without order in time."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    ConditionalGaussians,
    GaussianMixture,
    GaussianRegression,
    conditional_gaussians,
    log_input_densities,
    regress_with_responsibilities,
)
from pilotfish.models.skill import AdaptedSkill
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type


def as_mixture(model: AdaptedSkill) -> GaussianMixture:
    """The adapted states of a mixture skill, ready for gaussians.regress: y and its derivative, given x.

    Raises: InvalidInput for a skill with dynamics, whose states weigh differently at every time, and for one
    with orientations on S^3.
    """
    if model.dynamics.has_time_order:
        raise InvalidInput(
            f"the skill has {model.dynamics.name} dynamics, expected a mixture with fixed weights; learn it with "
            'dynamics="mixture", or use models.filtered_regression'
        )
    if model.layout.orientation_starts:
        raise InvalidInput(
            "the skill holds orientations as points of S^3, which a flat mixture cannot; use "
            "models.filtered_regression(model, inputs, x)"
        )
    return GaussianMixture(model.dynamics.initial, model.means, model.covariances)


def filtered_regression(
    model: AdaptedSkill, inputs: Int[Array, " I"], x: Float[Array, "T _"]
) -> GaussianRegression:
    """The columns that are not inputs at each step, given the inputs at this step and all before it.

    For use while the inputs come in: step t does not depend on later rows. States speak for the probability
    that the chain is in them, which the inputs alone drive; inputs that look alike at two moments are told
    apart by what led there. jacobians[t] is the exact derivative with respect to x[t], the past held.
    A mixture has no past: its answer is that of gaussians.regress. Quaternions are four numbers; bring those
    that come out to unit length. Orientations on S^3 are given and come out whole, as points of it.
    Raises: InvalidInput, when inputs are no columns, leave none to predict or tear an orientation apart, or x
    does not fit them or has no row; NotPositiveDefinite, when a state is singular in the inputs.
    Source: Calinon et al. 2010, Learning and reproduction of gestures by imitation, where a Markov chain's
    forward variable weighs the states; ours: explicit durations too, the covariance, the exact derivative.
    """
    conditional, log_observed = _condition_on_inputs(model, inputs, x)
    if not model.dynamics.has_time_order:
        return regress_with_responsibilities(
            conditional, x, model.dynamics.smoothed_state_probs(log_observed)
        )
    filtered = model.dynamics.filtered_state_probs(log_observed, len(x))
    return regress_with_responsibilities(conditional, x, filtered)


def smoothed_regression(
    model: AdaptedSkill, inputs: Int[Array, " I"], x: Float[Array, "T _"]
) -> GaussianRegression:
    """The columns that are not inputs at each step, given the inputs at all T steps.

    For use when all inputs are known, say one half of a recorded movement: what follows a step helps to tell
    in which state it was. jacobians[t] is the exact derivative of means[t] with respect to x[t], all other
    steps held; means[t] depends on these too.
    Raises: InvalidInput and NotPositiveDefinite, as filtered_regression does.
    """
    conditional, log_observed = _condition_on_inputs(model, inputs, x)
    return regress_with_responsibilities(conditional, x, model.dynamics.smoothed_state_probs(log_observed))


def _condition_on_inputs(
    model: AdaptedSkill, inputs: Int[Array, " I"], x: Float[Array, "T _"]
) -> tuple[ConditionalGaussians, Float[Array, "T K"]]:
    """The states as maps from inputs to the rest, and log p(x_t | state)."""
    require_type(model, "model", AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    require_type(x, "x", np.ndarray, "give an array, a row for each step")
    if not len(x):
        raise InvalidInput("x has no rows, expected the inputs of at least one step")
    conditional = conditional_gaussians(
        model.means, model.covariances, inputs, model.layout.orientation_starts
    )
    return conditional, log_input_densities(conditional, x)
