"""Notes about a motion: where it starts and ends relative to the states of its skill."""

import numpy as np

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.models import AdaptedSkill
from pilotfish.types import Array, Float

MAX_DEVIATIONS = 6.0  # standard deviations of a state, beyond which a start is extrapolation


def coordinate_parts(layout: Layout) -> list[tuple[Part, slice]]:
    """Return the parts that are not derivatives, with their columns."""
    return [
        (part, columns)
        for part, columns in zip(layout.parts, layout.slices, strict=True)
        if not part.derivative
    ]


def final_states(model: AdaptedSkill) -> list[int]:
    """Return the states without transitions to other states; a cyclic skill has none."""
    return np.flatnonzero(model.dynamics.final_states()).tolist()


def reaches_final_state(model: AdaptedSkill, last: int) -> bool | None:
    """Return whether a plan that ends in state last ends in a final state; None if the skill has none."""
    finals = final_states(model)
    return last in finals if finals else None


def end_notes(model: AdaptedSkill, last: int) -> list[str]:
    """Return a note if a plan that ends in state last ends before the skill does."""
    if reaches_final_state(model, last) is not False:
        return []
    names = " or ".join(map(str, final_states(model)))
    return [f"the motion ends in state {last}, before the final state {names}; pass a longer --horizon"]


def start_notes(model: AdaptedSkill, start: Float[Array, " D"]) -> list[str]:
    """Return a note for each part in which the start is far from every state.

    Far means farther than any two states are from each other, and more than MAX_DEVIATIONS standard
    deviations.
    """
    notes = []
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
            notes.append(
                f"the start's {part.name} is {gaps.min():.3g} {model.layout.distance_unit(columns)} from "
                "the nearest state, farther than any two states are from each other "
                f"({extent:.3g}): the motion there is extrapolation"
            )
    return notes
