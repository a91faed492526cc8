"""A motion as a file, and what is worth a remark about it: where it starts, where it ends."""

import csv
from pathlib import Path

import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Layout, Part, Quantity, distance_unit, distances
from pilotfish.models import AdaptedSkill
from pilotfish.types import Array, Float

MAX_DEVIATIONS = 6.0  # deviations of a state; beyond them nothing of it was ever shown


def coordinate_parts(layout: Layout) -> list[tuple[Part, slice]]:
    """The parts that are no derivatives, and their columns."""
    return [(p, here) for p, here in zip(layout.parts, layout.slices, strict=True) if p.derivative == 0]


def normalise_quaternions(x: Float[Array, "T D"], layout: Layout) -> Float[Array, "T D"]:
    """Every orientation brought back to unit length; the motion of a linear system leaves it a little.

    On S^3, where motions come from a map of it, it has that length already.
    """
    normalised = x.copy()
    for here in layout.quaternions:
        normalised[:, here] /= np.linalg.norm(x[:, here], axis=1, keepdims=True)
    return normalised


def write_motion(path: Path, motion: Motion, layout: Layout) -> None:
    """Every number with the digits it takes to read it back equal."""
    header = [f"{name} [{unit}]" for name, unit in zip(layout.names, layout.units, strict=True)]
    rows = normalise_quaternions(motion.x, layout).tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time [s]", *header])
        writer.writerows([round_time(motion.period * t), *row] for t, row in enumerate(rows))


def round_time(seconds: float) -> float:
    """0.3, where float64 multiplies to 0.30000000000000004."""
    return float(f"{seconds:.12g}")


def final_states(model: AdaptedSkill) -> list[int]:
    """Those after which nothing comes; a skill that goes round has none."""
    return np.flatnonzero(model.dynamics.final_states()).tolist()


def reaches_final_state(model: AdaptedSkill, last: int) -> bool | None:
    """Whether a plan that ends in state last comes to one after which nothing comes; None without such."""
    finals = final_states(model)
    return last in finals if finals else None


def end_notes(model: AdaptedSkill, last: int) -> list[str]:
    """A remark when the motion ends before the skill does."""
    if reaches_final_state(model, last) is not False:
        return []
    names = " or ".join(map(str, final_states(model)))
    return [f"the motion ends in state {last}, before the final state {names}; a longer --horizon goes on"]


def start_notes(model: AdaptedSkill, start: Float[Array, " D"]) -> list[str]:
    """A remark for each part in which the start lies far from every state.

    Far is farther than any two states are from each other, and beyond six deviations of each.
    """
    notes = []
    for (part, here), (_, there) in zip(
        coordinate_parts(model.layout), coordinate_parts(model.layout.tangent), strict=True
    ):
        gaps = distances(model.layout, here, model.means, start)
        extent = max(float(distances(model.layout, here, model.means, mean).max()) for mean in model.means)
        deviations = np.sqrt(np.linalg.eigvalsh(model.covariances[:, there, there])[:, -1])
        if part.quantity is Quantity.QUATERNION:  # turning by an angle moves its four numbers half as far
            deviations *= 2.0
        if here in model.layout.unit_quaternions:
            deviations = np.degrees(deviations)
        if (gaps > extent).all() and (gaps > MAX_DEVIATIONS * deviations).all():
            notes.append(
                f"the start's {part.name} is {gaps.min():.3g} {distance_unit(model.layout, here)} from the "
                f"nearest state, farther than any two states are from each other ({extent:.3g}): the motion "
                "there is extrapolation"
            )
    return notes
