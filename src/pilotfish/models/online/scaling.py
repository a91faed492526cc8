"""Columns of different units and sizes, brought to one scale for streams, which have one noise."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    demonstration,
    frame,
    moving_frame,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_type


@dataclass(frozen=True, slots=True, eq=False)
class ColumnScales:
    """What one is in each column of a layout; columns of a part share theirs, so that frames still turn them.

    means are those of the skill that tells the scales, [frame, state]: signs of quaternions follow them.
    """

    layout: Layout
    values: Float[Array, " D"]
    means: Float[Array, "P K D"]


def estimate_scales(skill: Skill) -> ColumnScales:
    """The deviation within states of each part, over all states and frames.

    So a batch fit of a few demonstrations tells by how much each quantity varies where the task is the same.
    Raises: InvalidInput, when the skill has orientations on S^3, or a part never varies.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    if skill.layout.orientation_starts:
        raise InvalidInput(
            "the skill has orientations on S^3, which streams take as four numbers; learn it from "
            "demonstrations that have them so"
        )
    variances = np.mean([np.diagonal(c.dense, axis1=1, axis2=2) for c in skill.covariances], axis=(0, 1))
    values = np.empty(skill.width)
    for part, columns in zip(skill.layout.parts, skill.layout.slices, strict=True):
        if not (spread := float(np.sqrt(variances[columns].mean()))) > 0.0:
            raise InvalidInput(f"part {part.name!r} never varies within states; leave it out, or regularise")
        values[columns] = spread
    return ColumnScales(skill.layout, values, skill.means)


def scale_demonstration(shown: Demonstration, scales: ColumnScales) -> Demonstration:
    """The same showing in units of the scales, seen from the same frames; its columns are plain numbers.

    What each frame sees has the sign of quaternions that runs closer to the skill's states.
    Raises: InvalidInput, when its columns or the number of its frames are not those of the scales.
    """
    if scales.values.shape != (scales.layout.width,):
        raise InvalidInput(
            f"the scales have values of shape {scales.values.shape}, expected ({scales.layout.width},)"
        )
    if shown.layout != scales.layout or len(shown.frames) != len(scales.means):
        raise InvalidInput(
            f"demonstration {shown.name!r} has the columns {', '.join(shown.layout.names)} and "
            f"{len(shown.frames)} frames, the scales are of {', '.join(scales.layout.names)} and "
            f"{len(scales.means)} frames"
        )
    seen = views([shown]).x
    frames = [
        _scale_frame(given, scales.values, _choose_quaternion_signs(x, means, shown.layout))
        for given, x, means in zip(shown.frames, seen, scales.means, strict=True)
    ]
    return demonstration(
        shown.x / scales.values, shown.period, _scalar_layout(shown.layout), frames, shown.name
    )


def unscale_skill(skill: Skill, scales: ColumnScales) -> Skill:
    """A skill that was learned of scaled demonstrations, in the columns that they had before.

    Raises: InvalidInput, when its columns are not those that scaling by these scales leaves.
    """
    if skill.layout != _scalar_layout(scales.layout):
        raise InvalidInput(
            f"the skill has the columns {', '.join(skill.layout.names)}, expected those of demonstrations "
            "that were scaled by these scales"
        )
    squares = np.outer(scales.values, scales.values)
    covariances = tuple(DenseCovariances(c.dense * squares) for c in skill.covariances)
    return replace(skill, means=skill.means * scales.values, covariances=covariances, layout=scales.layout)


def _scalar_layout(layout: Layout) -> Layout:
    return Layout(
        tuple(Part(part.name, Quantity.SCALAR, part.size, "1", part.derivative) for part in layout.parts)
    )


def _choose_quaternion_signs(
    x: Float[Array, "T D"], means: Float[Array, "K D"], layout: Layout
) -> Float[Array, " D"]:
    """Minus one for the columns of orientations that run closer to the states' means when negated."""
    signs = np.ones(layout.width)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION:
            here = layout.columns(part.name)
            similarity = x[:, here] @ means[:, here].T  # of each step and state
            nearest = np.abs(similarity).argmax(axis=1)
            if similarity[np.arange(len(x)), nearest].sum() < 0.0:
                signs[columns] = -1.0
    return signs


def _scale_frame(
    given: Frame | MovingFrame, values: Float[Array, " D"], signs: Float[Array, " D"]
) -> Frame | MovingFrame:
    """World and what is seen both divided by the scales: world' = (S^-1 A s S) seen' + S^-1 b."""
    A, b = given.A * (signs * values) / values[:, None], given.b / values
    return moving_frame(given.name, A, b) if given.is_moving else frame(given.name, A, b)
