"""Ranges of the demonstrations, with which notes compare a motion and its situation.

Parts. Every part of coordinates has a size, a speed and an acceleration, each one number that no rotation of
the axes changes: with rows x_t, period h and the distance |.| of the part (an angle for an orientation),

    size = max |x_t - x_1|,   speed = max |x_t+1 - x_t| / h,   acceleration = max |v_t+1 - v_t| / h.

Frames. The origin of a frame has a lowest and a highest value in each column. Its rotation is that of the
position: the orthogonal factor U of A = U S (polar decomposition). With U_0 the orthogonal factor of the mean
of all A, the angle between the two is 2 arcsin(|U - U_0| / 8^(1/2)), in two axes and in three.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations import Demonstration, Frame, Layout, MovingFrame, Part, Quantity
from pilotfish.geometry import log_map, normalise
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MotionRanges:
    """Lengths, sizes, speeds and accelerations of the demonstrations.

    Arrays have one value for each part of coordinates, in its unit; that of an orientation is an angle [rad].

    Attributes:
        shortest: Number of steps of the shortest demonstration.
        longest: Number of steps of the longest demonstration.
        smallest_sizes: Smallest size of a demonstration: the largest distance from its first row.
        largest_sizes: Largest size of a demonstration.
        speeds: Largest speed.
        accelerations: Largest acceleration.
        start: First row of the first demonstration.
        start_distances: Largest distance of the first row of a demonstration from it.
    """

    shortest: int
    longest: int
    smallest_sizes: Float[Array, " Q"]
    largest_sizes: Float[Array, " Q"]
    speeds: Float[Array, " Q"]
    accelerations: Float[Array, " Q"]
    start: Float[Array, " D"]
    start_distances: Float[Array, " Q"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FrameRanges:
    """Where the frames of the demonstrations were.

    Attributes:
        lowest: Smallest offset of each frame.
        highest: Largest offset of each frame.
        orientations: Orthogonal factor of the mean of A of each frame.
        angles: Largest angle of a demonstrated frame to it [rad]; 0 without a position.
    """

    lowest: Float[Array, "P D"]
    highest: Float[Array, "P D"]
    orientations: Float[Array, "P D D"]
    angles: Float[Array, " P"]


def motion_ranges(demonstrations: Sequence[Demonstration], start: Float[Array, " D"]) -> MotionRanges:
    """Compute the ranges of lengths, sizes, speeds and accelerations.

    Args:
        demonstrations: At least one; all have the same layout and period.
        start: First row of the first demonstration of the set.
    """
    lengths = [len(demo.x) for demo in demonstrations]
    measures = np.array([measure_motion(demo.x, demo.layout, demo.period) for demo in demonstrations])
    sizes, speeds, accelerations = measures.swapaxes(0, 1)
    starts = np.array([demo.x[0] for demo in demonstrations])
    distances = [
        _largest(differences(part, start[columns], starts[:, columns]))
        for part, columns in coordinate_parts(demonstrations[0].layout)
    ]
    return MotionRanges(
        min(lengths),
        max(lengths),
        sizes.min(axis=0),
        sizes.max(axis=0),
        speeds.max(axis=0),
        accelerations.max(axis=0),
        start,
        np.array(distances),
    )


def merge_motion_ranges(a: MotionRanges, b: MotionRanges) -> MotionRanges:
    """Return the ranges of the demonstrations of both, with the same start.

    Args:
        a: Ranges of some demonstrations.
        b: Ranges of others.
    """
    return MotionRanges(
        min(a.shortest, b.shortest),
        max(a.longest, b.longest),
        np.minimum(a.smallest_sizes, b.smallest_sizes),
        np.maximum(a.largest_sizes, b.largest_sizes),
        np.maximum(a.speeds, b.speeds),
        np.maximum(a.accelerations, b.accelerations),
        a.start,
        np.maximum(a.start_distances, b.start_distances),
    )


def measure_motion(x: Float[Array, "T D"], layout: Layout, period: float) -> Float[Array, "3 Q"]:
    """Return size, largest speed and largest acceleration of each part of coordinates.

    Args:
        x: Rows of a motion.
        layout: Columns of x.
        period: Time between two rows [s].
    """
    measures = []
    for part, columns in coordinate_parts(layout):
        values = x[:, columns]
        offsets = differences(part, values[0], values)
        rates = differences(part, values[:-1], values[1:]) / period
        measures.append([_largest(offsets), _largest(rates), _largest(np.diff(rates, axis=0) / period)])
    return np.array(measures).T


def differences(part: Part, a: Float[Array, "*#T d"], b: Float[Array, "T d"]) -> Float[Array, "T e"]:
    """Return b - a, or the rotation vector from a to b [rad] if the part is an orientation.

    Args:
        part: Part whose columns are given.
        a: Values, or one value.
        b: Values.
    """
    if part.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION) and not part.derivative:
        return log_map(normalise(a), normalise(b), (0,))
    return np.asarray(b - a)


def coordinate_parts(layout: Layout) -> Iterator[tuple[Part, slice]]:
    """Return the parts that are not derivatives, with their columns.

    Args:
        layout: Columns of a recording.
    """
    pairs = zip(layout.parts, layout.slices, strict=True)
    return ((part, columns) for part, columns in pairs if not part.derivative)


def frame_offsets(
    demonstrations: Sequence[Demonstration],
) -> tuple[Float[Array, "P D"], Float[Array, "P D"], Float[Array, "P D D"]]:
    """Return smallest and largest offset of each frame, and the sum of its matrices A.

    Args:
        demonstrations: At least one; all have the same layout and frames.
    """
    ranges = []
    for frames in zip(*(demo.frames for demo in demonstrations), strict=True):
        offsets = np.concatenate([np.atleast_2d(frame.b) for frame in frames])
        matrices = [frame.at(0).A for frame in frames]
        ranges.append((offsets.min(axis=0), offsets.max(axis=0), sum(matrices)))
    lowest, highest, sums = map(np.array, zip(*ranges, strict=True))
    return lowest, highest, sums


def largest_frame_angles(
    demonstrations: Sequence[Demonstration], orientations: Float[Array, "P D D"]
) -> Float[Array, " P"]:
    """Return the largest angle of each frame to an orientation [rad].

    Args:
        demonstrations: At least one; all have the same layout and frames.
        orientations: Orthogonal matrix for each frame.
    """
    layout = demonstrations[0].layout
    pairs = zip(zip(*(demo.frames for demo in demonstrations), strict=True), orientations, strict=True)
    return np.array([max(frame_angle(frame, middle, layout) for frame in frames) for frames, middle in pairs])


def frame_angle(frame: Frame | MovingFrame, orientation: Float[Array, "D D"], layout: Layout) -> float:
    """Return the angle of the rotation from an orientation to a frame at its first step [rad].

    Args:
        frame: Frame.
        orientation: Orthogonal matrix, as in `FrameRanges`.
        layout: Columns of the frame.
    """
    for part, columns in coordinate_parts(layout):
        if part.quantity is Quantity.POSITION:
            block = orthogonal_factor(frame.at(0).A[columns, columns])
            chord = np.linalg.norm(block - orthogonal_factor(orientation[columns, columns]))
            return float(2.0 * np.arcsin(min(chord / np.sqrt(8.0), 1.0)))
    return 0.0


def orthogonal_factor(A: Float[Array, "d d"]) -> Float[Array, "d d"]:
    """Return the orthogonal matrix that is nearest to A.

    Args:
        A: Square matrix.
    """
    left, _, right = np.linalg.svd(A)
    return np.asarray(left @ right)


def _largest(vectors: Float[Array, "T d"]) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))
