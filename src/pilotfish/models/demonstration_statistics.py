"""Statistics of the demonstrations that a skill keeps: scales, ranges and two-valued columns.

Scale. Every default that has a unit is a multiple of the scale of its part, so that the same recording in
metres or in inches, at 10 Hz or at 200 Hz, gives the same motion. A part of coordinates x, or of derivatives
v, over all N datapoints has the scale

    s = sqrt(mean |x - mean(x)|^2),        s' = sqrt(mean |v|^2),

one number for all columns of the part, which a rotation of its axes does not change. An orientation has the
scale of its rotation vectors from the mean. s'^2 / s is the scale of accelerations.

Passes. The statistics are sums, minima and maxima over the demonstrations, so that they can be computed from
a set in parts: one pass for means and limits, one for spreads about the means. The mean of an orientation
takes a pass for each step of its iteration.

A part that is constant has no spread. Its scale is its largest magnitude, or 1 if it is zero; the scale of
its derivative is that over the duration of a demonstration.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial, reduce

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    count_at_limits,
    has_opposite_sign,
    require_compatible,
    select_switches,
)
from pilotfish.geometry import exp_map, karcher_mean, log_map
from pilotfish.models.demonstrated_ranges import (
    FrameRanges,
    MotionRanges,
    frame_offsets,
    largest_frame_angles,
    merge_motion_ranges,
    motion_ranges,
    orthogonal_factor,
)
from pilotfish.models.partitions import DemonstrationGroup, Partitions, as_groups, first_demonstration
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

CONSTANT = 1e-9  # of the magnitude: a smaller spread is rounding
RELATIVE_DEVIATION = 0.005  # of the scale of coordinates: their regularisation in EM
RELATIVE_RATE_DEVIATION = 0.2  # of the scale of derivatives
MAX_MEAN_ITERATIONS, MEAN_TOLERANCE = 100, 1e-12  # rad


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


def demonstration_statistics(
    demonstrations: Sequence[Demonstration] | Partitions[DemonstrationGroup],
) -> DemonstrationStatistics:
    """Compute scales and ranges of demonstrations, and find columns that switch.

    Args:
        demonstrations: At least one, or a set in parts; all have the same layout and period.
    """
    source = as_groups(demonstrations)
    first = first_demonstration(source)
    layout = first.layout
    sums = reduce(_add_sums, source.map(partial(_sums, first=first)))
    limits = sums.lowest, sums.highest
    means = [
        _fold_karcher_mean(source, first, columns, outer / sums.rows)
        if part.quantity is Quantity.ORIENTATION and not part.derivative
        else total / sums.rows
        for part, columns, total, outer in zip(
            layout.parts, layout.slices, sums.totals, sums.outer_products, strict=True
        )
    ]
    middles = np.array([orthogonal_factor(A / sums.demonstrations) for A in sums.frame_matrices])
    squares: Float[Array, " S"] = np.zeros(len(layout.parts))
    counts, angles = np.zeros(layout.width, dtype=np.int64), np.zeros(len(middles))
    second = partial(_deviations, first=first, means=means, limits=limits, middles=middles)
    for group_squares, group_counts, group_angles in source.map(second):
        squares = squares + group_squares
        counts, angles = counts + group_counts, np.maximum(angles, group_angles)
    roots = np.sqrt(squares / sums.rows)
    magnitudes = [float(np.abs([limit[columns] for limit in limits]).max()) for columns in layout.slices]
    return DemonstrationStatistics(
        _scales(roots, magnitudes, layout, first.period * sums.rows / sums.demonstrations),
        *limits,
        select_switches(counts, sums.rows, limits, layout),
        sums.motion,
        FrameRanges(sums.frames_lowest, sums.frames_highest, middles, angles),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """Results of the first pass; totals and outer products have an entry for each part of the layout."""

    demonstrations: int
    rows: int
    lowest: Float[Array, " D"]
    highest: Float[Array, " D"]
    totals: list[Float[Array, " _"]]
    outer_products: list[Float[Array, "_ _"]]  # of orientations; others are 0
    motion: MotionRanges
    frames_lowest: Float[Array, "P D"]
    frames_highest: Float[Array, "P D"]
    frame_matrices: Float[Array, "P D D"]


def _sums(group: DemonstrationGroup, first: Demonstration) -> _Sums:
    require_compatible(group.demonstrations, first, group.start)
    x, layout = _aligned_rows(group, first), first.layout
    parts = list(zip(layout.parts, (x[:, columns] for columns in layout.slices), strict=True))
    return _Sums(
        len(group.demonstrations),
        len(x),
        x.min(axis=0),
        x.max(axis=0),
        [values.sum(axis=0) for _, values in parts],
        [
            values.T @ values if part.quantity is Quantity.ORIENTATION else np.zeros((1, 1))
            for part, values in parts
        ],
        motion_ranges(group.demonstrations, first.x[0]),
        *frame_offsets(group.demonstrations),
    )


def _add_sums(a: _Sums, b: _Sums) -> _Sums:
    return _Sums(
        a.demonstrations + b.demonstrations,
        a.rows + b.rows,
        np.minimum(a.lowest, b.lowest),
        np.maximum(a.highest, b.highest),
        [s + t for s, t in zip(a.totals, b.totals, strict=True)],
        [s + t for s, t in zip(a.outer_products, b.outer_products, strict=True)],
        merge_motion_ranges(a.motion, b.motion),
        np.minimum(a.frames_lowest, b.frames_lowest),
        np.maximum(a.frames_highest, b.frames_highest),
        a.frame_matrices + b.frame_matrices,
    )


def _deviations(
    group: DemonstrationGroup,
    first: Demonstration,
    means: list[Float[Array, " _"]],
    limits: tuple[Float[Array, " D"], Float[Array, " D"]],
    middles: Float[Array, "P D D"],
) -> tuple[Float[Array, " S"], Int[Array, " D"], Float[Array, " P"]]:
    """Return the second pass: squared deviations of parts, rows at limits, and angles of frames."""
    x, layout = _aligned_rows(group, first), first.layout
    squares = [
        np.sum(_deviation(part, mean, x[:, columns]) ** 2, axis=1).sum()
        for part, columns, mean in zip(layout.parts, layout.slices, means, strict=True)
    ]
    angles = largest_frame_angles(group.demonstrations, middles)
    return np.array(squares), count_at_limits(x, *limits), angles


def _deviation(part: Part, mean: Float[Array, " d"], values: Float[Array, "N d"]) -> Float[Array, "N e"]:
    if part.derivative:
        return values
    if part.quantity is Quantity.ORIENTATION:
        return log_map(mean, values, (0,))
    return np.asarray(values - mean)


def _fold_karcher_mean(
    source: Partitions[DemonstrationGroup],
    first: Demonstration,
    columns: slice,
    outer_product: Float[Array, "4 4"],
) -> Float[Array, "4"]:
    """Return the mean of an orientation as `karcher_mean` does, with a pass over the set for each step."""
    mean = np.linalg.eigh(outer_product)[1][:, -1]
    for _ in range(MAX_MEAN_ITERATIONS):
        sums = list(source.map(partial(_sum_of_logs, first=first, columns=columns, mean=mean)))
        step = np.sum([total for total, _ in sums], axis=0) / sum(rows for _, rows in sums)
        mean = exp_map(mean, step, (0,))
        if np.abs(step).max() < MEAN_TOLERANCE:
            break
    return np.asarray(mean)


def _sum_of_logs(
    group: DemonstrationGroup, first: Demonstration, columns: slice, mean: Float[Array, "4"]
) -> tuple[Float[Array, "3"], int]:
    values = _aligned_rows(group, first)[:, columns]
    return log_map(mean, values, (0,)).sum(axis=0), len(values)


def _aligned_rows(group: DemonstrationGroup, first: Demonstration) -> Float[Array, "N D"]:
    return np.concatenate([_align_signs(demo, first) for demo in group.demonstrations])


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
    roots, magnitudes = [], []
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        values = x[:, columns]
        if part.derivative:
            mean = np.zeros(part.size)
        elif part.quantity is Quantity.ORIENTATION:
            mean = karcher_mean(values, weights, (0,))
        else:
            mean = np.average(values, axis=0, weights=weights)
        roots.append(_root_mean_square(_deviation(part, mean, values), weights))
        magnitudes.append(float(np.abs(values).max()))
    return _scales(np.array(roots), magnitudes, layout, duration)


def _scales(
    roots: Float[Array, " S"], magnitudes: Sequence[float], layout: Layout, duration: float
) -> Float[Array, " E"]:
    """Return the scale of each tangent column from the root mean squares and magnitudes of the parts."""
    coordinates: dict[str, float] = {}
    scales = []
    for part, root, magnitude in zip(layout.parts, roots.tolist(), magnitudes, strict=True):
        scale = root
        if part.derivative:
            if scale <= CONSTANT * (reference := coordinates.get(part.name, 1.0)) / duration:
                scale = reference / duration**part.derivative
        else:
            limit = 1.0 if part.quantity is Quantity.ORIENTATION else magnitude
            scale = coordinates[part.name] = root if root > CONSTANT * limit else limit or 1.0
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


def _root_mean_square(values: Float[Array, "N d"], weights: Float[Array, " N"]) -> float:
    return float(np.sqrt(np.average(np.sum(values**2, axis=1), weights=weights)))
