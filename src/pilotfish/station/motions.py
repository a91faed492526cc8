"""A motion as a file, and what is worth a remark about it: where it starts, where it ends."""

import csv
from pathlib import Path

import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.models import AdaptedSkill, Weights
from pilotfish.types import Array, Float

FAR = 6.0  # deviations of a state; beyond them nothing of it was ever shown


def places(layout: Layout) -> list[tuple[Part, slice]]:
    """The parts that are no derivatives, and their columns."""
    return [(p, here) for p, here in zip(layout.parts, layout.slices, strict=True) if p.derivative == 0]


def on_the_sphere(x: Float[Array, "T D"], layout: Layout) -> Float[Array, "T D"]:
    """Every orientation brought back to unit length; the motion of a linear system leaves it a little."""
    brought = x.copy()
    for here in layout.quaternions:
        brought[:, here] /= np.linalg.norm(x[:, here], axis=1, keepdims=True)
    return brought


def write_motion(path: Path, motion: Motion, layout: Layout) -> None:
    """Every number with the digits it takes to read it back equal."""
    header = [f"{name} [{unit}]" for name, unit in zip(layout.names, layout.units, strict=True)]
    rows = on_the_sphere(motion.x, layout).tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time [s]", *header])
        writer.writerows([rounded(motion.period * t), *row] for t, row in enumerate(rows))


def rounded(seconds: float) -> float:
    """0.3, where float64 multiplies to 0.30000000000000004."""
    return float(f"{seconds:.12g}")


def final_states(model: AdaptedSkill) -> list[int]:
    """Those after which nothing comes; a skill that goes round has none."""
    if isinstance(model.dynamics, Weights):
        return []
    onward = model.dynamics.transitions.copy()
    np.fill_diagonal(onward, 0.0)
    return np.flatnonzero(~onward.any(axis=1)).tolist()


def final_state_reached(model: AdaptedSkill, last: int) -> bool | None:
    """Whether a plan that ends in state last comes to one after which nothing comes; None without such."""
    finals = final_states(model)
    return last in finals if finals else None


def notes_on_the_end(model: AdaptedSkill, last: int) -> list[str]:
    """A remark when the motion ends before the skill does."""
    if final_state_reached(model, last) is not False:
        return []
    names = " or ".join(map(str, final_states(model)))
    return [f"the motion ends in state {last}, before the final state {names}; a longer --horizon goes on"]


def notes_on_the_start(model: AdaptedSkill, start: Float[Array, " D"]) -> list[str]:
    """A remark for each part in which the start lies far from every state.

    Far is farther than any two states are from each other, and beyond six deviations of each.
    """
    notes = []
    for part, here in places(model.layout):
        gaps = _gaps(model.means[:, here], start[here], part)
        extent = max(float(_gaps(model.means[:, here], mean, part).max()) for mean in model.means[:, here])
        variances = np.linalg.eigvalsh(model.covariances[:, here, here])[:, -1]
        if (gaps > extent).all() and (gaps > FAR * np.sqrt(variances)).all():
            notes.append(
                f"the start's {part.name} is {gaps.min():.3g} {part.unit} from the nearest state, farther "
                f"than any two states are from each other ({extent:.3g}): the motion there is extrapolation"
            )
    return notes


def _gaps(means: Float[Array, "K d"], value: Float[Array, " d"], part: Part) -> Float[Array, " K"]:
    gaps = np.linalg.norm(means - value, axis=1)
    if part.quantity is Quantity.QUATERNION:  # q and -q are one orientation
        gaps = np.minimum(gaps, np.linalg.norm(means + value, axis=1))
    return np.asarray(gaps)
