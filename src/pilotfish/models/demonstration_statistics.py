"""Statistics of the demonstrations that a skill keeps: scales, ranges and two-valued columns.

Scale. Every default that has a unit is a multiple of the scale of its part, so that the same recording in
metres or in inches, at 10 Hz or at 200 Hz, gives the same motion. A part of coordinates x, or of derivatives
v, over all N datapoints has the scale

    s = sqrt(mean |x - mean(x)|^2),        s' = sqrt(mean |v|^2),

one number for all columns of the part, which a rotation of its axes does not change. An orientation has the
scale of its rotation vectors from the mean. s'^2 / s is the scale of accelerations.

A part that is constant has no spread. Its scale is its largest magnitude, or 1 if it is zero; the scale of
its derivative is that over the duration of a demonstration.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    has_opposite_sign,
    switching_columns,
)
from pilotfish.geometry import karcher_mean, log_map
from pilotfish.models.demonstrated_ranges import FrameRanges, MotionRanges, frame_ranges, motion_ranges
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

CONSTANT = 1e-9  # of the magnitude: a smaller spread is rounding
RELATIVE_DEVIATION = 0.005  # of the scale of coordinates: their regularisation in EM
RELATIVE_RATE_DEVIATION = 0.2  # of the scale of derivatives


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class DemonstrationStatistics:
    """What a skill keeps of its demonstrations beside the states.

    Attributes:
        scales: Scale of each tangent column, as at the head of this file.
        lowest: Smallest value of each column.
        highest: Largest value of each column.
        switches: Names of the columns that take two values only, such as a gripper's command.
        motion: Lengths, sizes, speeds and accelerations.
        frames: Where the frames were.
    """

    scales: Float[Array, " E"]
    lowest: Float[Array, " D"]
    highest: Float[Array, " D"]
    switches: tuple[str, ...]
    motion: MotionRanges
    frames: FrameRanges


def demonstration_statistics(demonstrations: Sequence[Demonstration]) -> DemonstrationStatistics:
    """Compute scales and ranges of demonstrations, and find columns that switch.

    Args:
        demonstrations: At least one; all have the same layout and period.
    """
    first = demonstrations[0]
    x = np.concatenate([_align_signs(demo, first) for demo in demonstrations])
    duration = first.period * len(x) / len(demonstrations)
    lowest, highest = x.min(axis=0), x.max(axis=0)
    scales = part_scales(x, np.ones(len(x)), first.layout, duration)
    return DemonstrationStatistics(
        scales,
        lowest,
        highest,
        switching_columns(x, first.layout),
        motion_ranges(demonstrations),
        frame_ranges(demonstrations),
    )


def _align_signs(demo: Demonstration, reference: Demonstration) -> Float[Array, "T D"]:
    """Return the datapoints with quaternions in R^4 on the half of S^3 of the reference."""
    negated = [
        columns
        for columns in demo.layout.quaternions
        if has_opposite_sign(demo.x[:, columns], reference.x[:, columns])
    ]
    return demo.x * demo.layout.quaternion_signs(negated) if negated else demo.x


def part_scales(
    x: Float[Array, "N D"], weights: Float[Array, " N"], layout: Layout, duration: float
) -> Float[Array, " E"]:
    """Compute the scale of each tangent column.

    Args:
        x: Datapoints.
        weights: Weight of each datapoint.
        layout: Columns of x.
        duration: Duration of a demonstration [s], for derivatives of constant parts.
    """
    coordinates: dict[str, float] = {}
    scales = []
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        values = x[:, columns]
        if part.derivative:
            scale = _root_mean_square(values, weights)
            if scale <= CONSTANT * (reference := coordinates.get(part.name, 1.0)) / duration:
                scale = reference / duration**part.derivative
        else:
            scale = coordinates[part.name] = _spread(values, weights, part)
        scales.append(scale)
    return np.repeat(scales, [part.size for part in layout.tangent.parts])


def default_regularisation(scales: Float[Array, " E"], layout: Layout) -> Float[Array, " E"]:
    """Return the variance that EM adds to each tangent column by default.

    Args:
        scales: Scale of each tangent column.
        layout: Columns of the datapoints.
    """
    parts = layout.tangent.parts
    fractions = [RELATIVE_RATE_DEVIATION if part.derivative else RELATIVE_DEVIATION for part in parts]
    return np.asarray((np.repeat(fractions, [part.size for part in parts]) * scales) ** 2)


def _spread(values: Float[Array, "N d"], weights: Float[Array, " N"], part: Part) -> float:
    if part.quantity is Quantity.ORIENTATION:
        deviations = log_map(karcher_mean(values, weights, (0,)), values, (0,))
        magnitude = 1.0
    else:
        deviations = values - np.average(values, axis=0, weights=weights)
        magnitude = float(np.abs(values).max())
    scale = _root_mean_square(deviations, weights)
    return scale if scale > CONSTANT * magnitude else magnitude or 1.0


def _root_mean_square(values: Float[Array, "N d"], weights: Float[Array, " N"]) -> float:
    return float(np.sqrt(np.average(np.sum(values**2, axis=1), weights=weights)))
