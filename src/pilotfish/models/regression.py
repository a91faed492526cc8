"""Regression with a skill that has no order in time: its states as one mixture."""

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Mixture
from pilotfish.models.dynamics import Weights
from pilotfish.models.skill import AdaptedSkill


def as_mixture(model: AdaptedSkill) -> Mixture:
    """The adapted states of a mixture skill, ready for gaussians.regress: y and its derivative, given x.

    Raises: InvalidInput for a skill with dynamics, whose states weigh differently at every time; build
    Mixture(occupancy[t], model.means, model.covariances) for the time in question.
    """
    if not isinstance(model.dynamics, Weights):
        raise InvalidInput(
            f"the skill has {type(model.dynamics).__name__} dynamics, no fixed weights; learn it with "
            "pf.learn_mixture, or weigh its states with a row of models.occupancy"
        )
    return Mixture(model.dynamics.weights, model.means, model.covariances)
