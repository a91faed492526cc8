"""From an adapted skill to a step-wise reference: where to be at each step, and how much it matters."""

import numpy as np

from pilotfish.control import Reference
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.gaussians import cholesky
from pilotfish.models import AdaptedSkill, log_likelihood_of_states, most_probable_states, on_the_half_of
from pilotfish.types import Array, Float, Int
from pilotfish.validation import LARGEST_MAGNITUDE, numeric_array, require_count, short_repr

LONGEST_HORIZON = 10**6  # steps

MOST_WEIGHTS = 2**26  # numbers in the weights of all steps: 512 MiB


def plan(model: AdaptedSkill, start: Float[Array, " D"], *, horizon: int, slack: float = 2e-3) -> Reference:
    """The reference of the most probable states over horizon steps, from where the robot is now.

    start is taken as the first observation: of the states in which the skill may begin, the one that explains
    it goes first. Targets have the sign of the start's quaternions, q and -q being one orientation.
    slack [unit of x squared] is added to every variance before it becomes a weight, so that no direction is
    followed with more than 1 / slack, however well demonstrations agreed.
    Raises: InvalidInput, when start, horizon or slack cannot be used, or the skill has orientations on S^3.
    Source: Tanwani 2018, equations 3.41-3.43, with Q_t = (Sigma + slack I)^-1.
    """
    refuse_curved(model)
    here, states = _from(model, start, horizon)
    return reference(here, states, slack)


def planned_states(model: AdaptedSkill, start: Float[Array, " D"], *, horizon: int) -> Int[Array, " T"]:
    """The state that a plan from start is in at each of horizon steps.

    Raises: InvalidInput, when start or horizon cannot be used.
    """
    return _from(model, start, horizon)[1]


def _from(
    model: AdaptedSkill, start: Float[Array, " D"], horizon: int
) -> tuple[AdaptedSkill, Int[Array, " T"]]:
    """The skill on the start's half of S^3, and its most probable states from there."""
    require_kind("model", model, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    require_kind("start", start, np.ndarray, "give np.array(start)")
    require_count(horizon, "horizon", LONGEST_HORIZON, lowest=1)
    start = numeric_array(start, "start")
    if start.shape != (width := model.means.shape[1],):
        raise InvalidInput(
            f"start has shape {start.shape}, expected ({width},): {', '.join(model.layout.names)}"
        )
    if not np.isfinite(start).all():
        raise InvalidInput(f"start holds values that are not finite: {start.tolist()}")
    here = on_the_half_of(start, model)
    return here, most_probable_states(here.dynamics, log_likelihood_of_states(here, start[None]), horizon)


def expected_plan(model: AdaptedSkill, *, horizon: int, slack: float = 2e-3) -> Reference:
    """The reference that the skill itself expects, wherever the robot is: no observation taken.

    Raises: InvalidInput, when horizon or slack cannot be used.
    """
    require_kind("model", model, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    require_count(horizon, "horizon", LONGEST_HORIZON, lowest=1)
    nothing = np.empty((0, model.states))
    return reference(model, most_probable_states(model.dynamics, nothing, horizon), slack)


def refuse_curved(model: AdaptedSkill) -> None:
    """Raises: InvalidInput, when the skill has orientations on S^3: no straight line leads between two."""
    require_kind("model", model, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    if model.layout.turns:
        raise InvalidInput(
            "the skill has orientations on S^3, which linear systems do not follow; plan on a flat map of "
            "it: chart = pf.chart(model), then pf.plan(chart.skill, chart.inward(start), ...), and "
            "chart.outward(motion.x) are the poses"
        )


def reference(model: AdaptedSkill, states: Int[Array, " T"], slack: float) -> Reference:
    """Means and weights (covariance + slack I)^-1 of a given state sequence."""
    refuse_curved(model)
    require_kind("slack", slack, (float, int), "give a variance")
    if not 0.0 <= slack <= LARGEST_MAGNITUDE:
        raise InvalidInput(f"slack is {slack}, expected a finite variance of at least 0")
    require_kind("states", states, np.ndarray, "give np.array(states)")
    if states.dtype.kind not in "iu" or states.ndim != 1:
        raise InvalidInput(f"states is {short_repr(states)}, expected an array of whole numbers, one a step")
    if not (states.size and 0 <= states.min() <= states.max() < model.states):
        raise InvalidInput(f"states is {short_repr(states)}, expected numbers from 0 to {model.states - 1}")
    if (numbers := states.size * model.means.shape[1] ** 2) > MOST_WEIGHTS:
        raise InvalidInput(
            f"the weights of {states.size} steps have {numbers} numbers, expected at most {MOST_WEIGHTS}; "
            "plan fewer steps at a time"
        )
    softened = model.covariances + slack * np.eye(model.means.shape[1])
    cholesky(softened, "the softened covariance of state")
    inverse = np.linalg.solve(softened, np.broadcast_to(np.eye(softened.shape[1]), softened.shape))
    weights = 0.5 * (inverse + inverse.transpose(0, 2, 1))
    return Reference(model.means[states], weights[states], model.period)
