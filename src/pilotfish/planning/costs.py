"""Default costs of a plan, as multiples of the scales of the demonstrations.

A column of scale s (`models/demonstration_statistics.py`) is never tracked more closely than s / 1000:
the variance (s / 1000)^2 is added to each of its covariances. Accelerations have the scale s'^2 / s,
with s' the scale of the derivative. The control cost is

    R = diag(c / (s'^2 / s)^2),    c = 0.01.

Against a state of deviation d = f s, a plan smooths over the time (R d^2)^(1/4) = 0.32 sqrt(f) s / s': a few
hundredths of the time that the movement takes to cross its own extent.
"""

import numpy as np

from pilotfish.models import AdaptedSkill, part_scales
from pilotfish.types import Array, Float

RELATIVE_CONTROL_COST = 0.01
RELATIVE_DEVIATION = 0.001
CROSSINGS = 10.0  # periods over which a constant column of a skill without statistics changes by its scale


def default_control_cost(adapted: AdaptedSkill) -> Float[Array, "m m"]:
    """Return the cost of squared accelerations for a skill of coordinates, then the derivative of each.

    Args:
        adapted: Adapted skill.

    Returns:
        A diagonal matrix R [1 / acceleration^2].
    """
    coordinates, rates = np.split(scales(adapted), 2)
    return np.diag(RELATIVE_CONTROL_COST * (coordinates / rates**2) ** 2)


def default_covariance_regularisation(adapted: AdaptedSkill) -> Float[Array, " E"]:
    """Return the variance added to each column of a covariance before it becomes a weight.

    Args:
        adapted: Adapted skill.
    """
    return np.asarray((RELATIVE_DEVIATION * scales(adapted)) ** 2)


def scales(adapted: AdaptedSkill) -> Float[Array, " E"]:
    """Return the scale of each tangent column: of the demonstrations, or else of the states.

    Args:
        adapted: Adapted skill.
    """
    if adapted.demonstrated is not None:
        return adapted.demonstrated.scales
    layout = adapted.layout
    duration = CROSSINGS * adapted.period
    between = part_scales(adapted.means, np.ones(adapted.states), layout, duration)
    within = np.diagonal(adapted.covariances, axis1=1, axis2=2).mean(axis=0)
    total = [within[columns].sum() for columns in layout.tangent.slices]
    return np.asarray(np.sqrt(between**2 + np.repeat(total, [part.size for part in layout.tangent.parts])))
