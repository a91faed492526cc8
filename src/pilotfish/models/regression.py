"""Gaussian mixture regression (GMR) with a skill: predict some columns given the others.

For a mixture the responsibilities of the states depend on the inputs of one step. For a Markov or semi-Markov
skill they depend on the inputs of the steps before (filtered) or of all steps (smoothed).
"""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    ConditionalGaussians,
    GaussianRegression,
    conditional_gaussians,
    regress_with_responsibilities,
)
from pilotfish.models.skill import AdaptedSkill
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type


def filtered_regression(
    model: AdaptedSkill, inputs: Int[Array, " I"], x: Float[Array, "T _"]
) -> GaussianRegression:
    """Predict the other columns at each step, given the inputs at this step and all before it.

    Use it while inputs arrive: step t does not depend on later rows. The responsibilities are the filtered
    state probabilities given the inputs, so that equal inputs at two moments are distinguished by their past.
    For a mixture the result is that of `GaussianMixture.regress`. Quaternions in R^4 are predicted as four
    numbers: normalise them. Orientations on S^3 are predicted as unit quaternions.

    Args:
        model: Adapted skill.
        inputs: Input columns; all four columns of an orientation on S^3, or none.
        x: Values of the input columns, one row per step.

    Returns:
        Means, covariances and jacobians. `jacobians[t]` is the exact derivative with respect to x[t] for a
        fixed past.

    Raises:
        InvalidInput: If inputs are not columns, leave no output or split an orientation, or x does not match
            them or has no row.
        NotPositiveDefinite: If the inputs of a state have a singular covariance.

    Source:
        Calinon et al. 2010, Learning and reproduction of gestures by imitation (forward variable of a Markov
        chain as responsibilities); explicit durations, the covariance and the exact derivative are ours.
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
    """Predict the other columns at each step, given the inputs at all steps.

    Use it when all inputs are known, such as one half of a recorded movement.

    Args:
        model: Adapted skill.
        inputs: Input columns; all four columns of an orientation on S^3, or none.
        x: Values of the input columns, one row per step.

    Returns:
        Means, covariances and jacobians. `jacobians[t]` is the exact derivative of means[t] with respect to
        x[t] for fixed inputs at all other steps, on which means[t] depends as well.

    Raises:
        InvalidInput: As in `filtered_regression`.
        NotPositiveDefinite: If the inputs of a state have a singular covariance.
    """
    conditional, log_observed = _condition_on_inputs(model, inputs, x)
    return regress_with_responsibilities(conditional, x, model.dynamics.smoothed_state_probs(log_observed))


def _condition_on_inputs(
    model: AdaptedSkill, inputs: Int[Array, " I"], x: Float[Array, "T _"]
) -> tuple[ConditionalGaussians, Float[Array, "T K"]]:
    """Return the states conditioned on the inputs, and log p(x_t | state)."""
    require_type(model, "model", AdaptedSkill, "pf.adapt(skill, frames) returns one")
    require_type(x, "x", np.ndarray, "give an array with one row per step")
    if not len(x):
        raise InvalidInput("x has no rows, expected the inputs of at least one step")
    conditional = conditional_gaussians(
        model.means, model.covariances, inputs, model.layout.orientation_starts
    )
    return conditional, conditional.log_input_densities(x)
