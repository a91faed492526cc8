"""Plans for objects that move while they are followed."""

from dataclasses import replace

import numpy as np

from pilotfish.control import Reference
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.models import AdaptedSkill
from pilotfish.planning.plan import reference
from pilotfish.types import Array, Int


def moving_reference(
    now: AdaptedSkill, later: AdaptedSkill, states: Int[Array, " T"], slack: float
) -> Reference:
    """The reference of a given state sequence, its targets moving evenly from those of now to those of later.

    now is the skill where the objects stand at the first step, later where they are expected at the last; in
    between they are taken to move evenly. Weights are those of now. Later quaternions have the sign that is
    nearer to those of now.
    Raises: InvalidInput, when the two differ in states or columns, or slack cannot be used.
    """
    for name, skill in (("now", now), ("later", later)):
        require_kind(name, skill, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    if now.means.shape != later.means.shape:
        raise InvalidInput(
            f"the skills now and later have means of shape {now.means.shape} and {later.means.shape}, "
            "expected the same skill adapted twice"
        )
    if now.layout != later.layout:
        raise InvalidInput(
            f"the skills now and later have the columns {', '.join(now.layout.names)} and "
            f"{', '.join(later.layout.names)}, expected the same skill adapted twice"
        )
    begins = reference(now, states, slack)
    means = later.means.copy()
    for columns in now.layout.quaternions:
        away = np.sum(means[:, columns] * now.means[:, columns], axis=1) < 0.0
        rates = _rates_of(columns, now)
        means[away, columns] *= -1.0
        means[away, rates] *= -1.0
    share = np.linspace(0.0, 1.0, len(states))[:, None]
    return replace(begins, targets=(1.0 - share) * begins.targets + share * means[states])


def _rates_of(columns: slice, model: AdaptedSkill) -> slice:
    """The columns of the derivative of a quaternion; none where the layout has no speeds."""
    parts = list(zip(model.layout.parts, model.layout.slices, strict=True))
    name = next(part.name for part, here in parts if here == columns)
    found = [here for part, here in parts if (part.name, part.derivative) == (name, 1)]
    return found[0] if found else slice(0, 0)
