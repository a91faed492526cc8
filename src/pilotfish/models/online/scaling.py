"""Scaling of columns with different units for online learners, which have one noise variance."""

from dataclasses import replace

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
from pilotfish.models.signs import nearest_quaternion_signs
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_type


def column_scales(skill: Skill) -> Float[Array, " D"]:
    """Return the standard deviation within states of each column, over all states and frames.

    Columns of one part of the layout share a scale, so that the rotations of frames still apply.

    Args:
        skill: Batch fit of a few demonstrations.

    Raises:
        InvalidInput: If the skill has orientations on S^3, or a part has no variance.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    if skill.layout.orientation_starts:
        raise InvalidInput(
            "the skill has orientations on S^3, expected quaternions as four numbers; learn it from "
            "demonstrations without on_sphere"
        )
    variances = np.mean([np.diagonal(c.dense, axis1=1, axis2=2) for c in skill.covariances], axis=(0, 1))
    scales = np.empty(skill.width)
    for part, columns in zip(skill.layout.parts, skill.layout.slices, strict=True):
        if not (deviation := float(np.sqrt(variances[columns].mean()))) > 0.0:
            raise InvalidInput(
                f"part {part.name!r} has no variance within states; leave it out, or regularise"
            )
        scales[columns] = deviation
    return scales


def scale_demonstration(
    original: Demonstration, scales: Float[Array, " D"], reference: Skill
) -> Demonstration:
    """Divide the columns of a demonstration by their scales.

    In each frame, quaternions have the sign that is closer to the means of the reference.

    Args:
        original: Demonstration with the layout and the number of frames of the reference.
        scales: Scale of each column, from `column_scales(reference)`.
        reference: Batch fit.

    Returns:
        A demonstration whose columns are dimensionless scalars, with frames that map between scaled columns.

    Raises:
        InvalidInput: If the layout, the number of frames or the number of scales does not fit.
    """
    if scales.shape != (reference.width,):
        raise InvalidInput(f"scales has shape {scales.shape}, expected ({reference.width},)")
    if original.layout != reference.layout or len(original.frames) != len(reference.means):
        raise InvalidInput(
            f"demonstration {original.name!r} has the columns {', '.join(original.layout.names)} and "
            f"{len(original.frames)} frames, expected {', '.join(reference.layout.names)} and "
            f"{len(reference.means)} frames as the reference has"
        )
    frames = [
        _scale_frame(given, scales, nearest_quaternion_signs(x, means, original.layout))
        for given, x, means in zip(original.frames, views([original]).x, reference.means, strict=True)
    ]
    layout = _scalar_layout(original.layout)
    return demonstration(original.x / scales, original.period, layout, frames, original.name)


def unscale_skill(skill: Skill, scales: Float[Array, " D"], layout: Layout) -> Skill:
    """Convert a skill learned from scaled demonstrations back to the original columns.

    Args:
        skill: Skill of scaled demonstrations.
        scales: Scale of each column.
        layout: Original layout.

    Returns:
        The skill with means and covariances in the units of the layout.

    Raises:
        InvalidInput: If the columns of the skill are not the scaled columns of the layout.
    """
    if skill.layout != _scalar_layout(layout):
        raise InvalidInput(
            f"the skill has the columns {', '.join(skill.layout.names)}, expected the scaled columns of "
            f"{', '.join(layout.names)}; learn it from scale_demonstration"
        )
    squares = np.outer(scales, scales)
    covariances = tuple(DenseCovariances(c.dense * squares) for c in skill.covariances)
    return replace(skill, means=skill.means * scales, covariances=covariances, layout=layout)


def _scalar_layout(layout: Layout) -> Layout:
    return Layout(
        tuple(Part(part.name, Quantity.SCALAR, part.size, "1", part.derivative) for part in layout.parts)
    )


def _scale_frame(
    given: Frame | MovingFrame, scales: Float[Array, " D"], signs: Float[Array, " D"]
) -> Frame | MovingFrame:
    """Return the frame between scaled columns: world' = (S^-1 A s S) view' + S^-1 b."""
    A, b = given.A * (signs * scales) / scales[:, None], given.b / scales
    return moving_frame(given.name, A, b) if given.is_moving else frame(given.name, A, b)
