"""Starts that are far from every state of a skill, so that the motion there is extrapolation."""

import numpy as np

from pilotfish.demonstrations import Quantity
from pilotfish.models import AdaptedSkill, coordinate_parts
from pilotfish.types import Array, Float

MAX_DEVIATIONS = 6.0  # standard deviations of a state, beyond which a start is extrapolation


def far_starts(model: AdaptedSkill, start: Float[Array, " D"]) -> dict[str, str]:
    """Return a note, by name, for each part in which the start is far from every state.

    Far means farther than any two states are from each other, and more than MAX_DEVIATIONS standard
    deviations.

    Args:
        model: Adapted skill.
        start: First row of a motion.
    """
    notes = {}
    for (part, columns), (_, tangent_columns) in zip(
        coordinate_parts(model.layout), coordinate_parts(model.layout.tangent), strict=True
    ):
        gaps = model.layout.distances(columns, model.means, start)
        extent = max(float(model.layout.distances(columns, model.means, mean).max()) for mean in model.means)
        covariances = model.covariances[:, tangent_columns, tangent_columns]
        deviations = np.sqrt(np.linalg.eigvalsh(covariances)[:, -1])
        if part.quantity is Quantity.QUATERNION:  # a rotation by an angle moves its quaternion half as far
            deviations *= 2.0
        if columns in model.layout.unit_quaternions:
            deviations = np.degrees(deviations)
        if (gaps > extent).all() and (gaps > MAX_DEVIATIONS * deviations).all():
            notes[part.name] = (
                f"the start's {part.name} is {gaps.min():.3g} {model.layout.distance_unit(columns)} from "
                "the nearest state, farther than any two states are from each other "
                f"({extent:.3g}): the motion there is extrapolation"
            )
    return notes
