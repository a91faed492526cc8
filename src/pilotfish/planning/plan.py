"""From an adapted skill to a step-wise reference: where to be at each step, and how much it matters."""

import numpy as np

from pilotfish.control import Reference
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import cholesky
from pilotfish.models import AdaptedSkill, log_likelihood_of_states, most_probable_states, on_the_half_of
from pilotfish.types import Array, Float, Int


def plan(model: AdaptedSkill, start: Float[Array, " D"], *, horizon: int, slack: float = 2e-3) -> Reference:
    """The reference of the most probable states over horizon steps, from where the robot is now.

    start is taken as the first observation: a robot that already stands at a later state begins there.
    Targets have the sign of the start's quaternions, q and -q being one orientation.
    slack [unit of x squared] is added to every variance before it becomes a weight, so that no direction is
    followed with more than 1 / slack, however well demonstrations agreed.
    Raises: InvalidInput, when start, horizon or slack cannot be used.
    Source: Tanwani 2018, equations 3.41-3.43, with Q_t = (Sigma + slack I)^-1.
    """
    if start.shape != (width := model.means.shape[1],):
        raise InvalidInput(
            f"start has {start.size} values, the skill has {width} columns: {model.layout.names}"
        )
    if not np.isfinite(start).all():
        raise InvalidInput(f"start holds values that are not finite: {start.tolist()}")
    model = on_the_half_of(start, model)
    observed = log_likelihood_of_states(model, start[None])
    return reference(model, most_probable_states(model.dynamics, observed, horizon), slack)


def expected_plan(model: AdaptedSkill, *, horizon: int, slack: float = 2e-3) -> Reference:
    """The reference that the skill itself expects, wherever the robot is: no observation taken."""
    nothing = np.empty((0, model.states))
    return reference(model, most_probable_states(model.dynamics, nothing, horizon), slack)


def reference(model: AdaptedSkill, states: Int[Array, " T"], slack: float) -> Reference:
    """Means and weights (covariance + slack I)^-1 of a given state sequence."""
    if not 0.0 <= slack < np.inf:
        raise InvalidInput(f"slack is {slack}, expected a variance of at least 0")
    softened = model.covariances + slack * np.eye(model.means.shape[1])
    cholesky(softened, "the softened covariance of state")
    inverse = np.linalg.solve(softened, np.broadcast_to(np.eye(softened.shape[1]), softened.shape))
    weights = 0.5 * (inverse + inverse.transpose(0, 2, 1))
    return Reference(model.means[states], weights[states])
