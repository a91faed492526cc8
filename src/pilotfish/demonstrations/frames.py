"""Frames (task parameters): the coordinate systems of the objects of a task.

A frame maps local coordinates to world coordinates, world = A @ local + b, for a whole row of a recording: a
position is rotated and translated, a vector rotated, a quaternion multiplied from the left, a scalar
unchanged. A moving frame has one A and one b per step.

Deviations. A small deviation of a point transforms as a difference does, by A. An orientation on S^3 is the
exception: its deviation is a rotation vector in body axes, and a left multiplication rotates the body axes
along. Deviations of orientations are therefore the same in every frame (`tangent_map`).

Derivatives. A static frame transforms a derivative by A alone. For a moving frame, x = A y + b gives forward
differences (x' - x) / h = A' (y' - y) / h + (A' - A) / h y + (b' - b) / h, where a prime marks the next step
and h is the period. Local derivatives are therefore differences of local points.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.demonstrations.differences import forward_differences, tangent_differences
from pilotfish.demonstrations.layouts import MAX_COLUMNS, Layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    left_multiplication_matrix,
    normalise,
    tangent_slices,
    unwrap_quaternions,
)
from pilotfish.types import Array, Float, Int
from pilotfish.validation import finite_array, float_array, require_count, require_name, shorten_repr

WORLD = "world"
MIN_SCALE, MAX_SCALE, MAX_OFFSET = 1e-20, 1e20, 1e50  # of A and of b; covariances take squares
MAX_CONDITION = 1e12  # beyond it, float64 leaves fewer than four digits of a local coordinate
ROTATION_TOLERANCE = 1e-4  # a published rotation matrix carries about six digits


class _AffineFrame:
    """Methods that static and moving frames share."""

    __slots__ = ()
    name: str
    A: Array
    b: Array

    @property
    def is_world(self) -> bool:
        """Whether a static frame has the same local and world coordinates, whatever its name."""
        return self.A.ndim == 2 and np.array_equal(self.A, np.eye(len(self.b))) and not self.b.any()

    def require_magnitudes(self) -> None:
        """Check that the frame can transform means and covariances without overflow.

        Raises:
            InvalidInput: If A or b is not finite, an entry of A exceeds 1e20 or one of b 1e50, or all entries
                of A are below 1e-20.
        """
        _require_magnitudes(f"frame {self.name!r}", self.A, self.b)

    def require_left_multiplication(self, layout: Layout) -> None:
        """Check that the frame maps each orientation on S^3 to S^3.

        Args:
            layout: Columns of the frame.

        Raises:
            InvalidInput: If it does anything but multiply an orientation from the left by a unit quaternion.
        """
        A, b = self.A, self.b
        for start in layout.orientation_starts:
            columns = np.arange(start, start + 4)
            block = A[..., columns[:, None], columns]
            others = np.delete(np.arange(A.shape[-1]), columns)
            worst = max(
                np.abs(block - left_multiplication_matrix(block[..., 0])).max(),
                np.abs(np.linalg.norm(block[..., 0], axis=-1) - 1.0).max(),
                np.abs(b[..., columns]).max(),
                np.abs(A[..., columns[:, None], others]).max(initial=0.0),
                np.abs(A[..., others[:, None], columns]).max(initial=0.0),
            )
            if worst > ROTATION_TOLERANCE:
                raise InvalidInput(
                    f"frame {self.name!r}: columns {start} to {start + 3} are an orientation on S^3, and A "
                    f"and b differ by {worst:.3g} from left multiplication by a unit quaternion, expected at "
                    f"most {ROTATION_TOLERANCE:g}; see frame_from_pose"
                )

    def tangent_map(self, layout: Layout) -> Float[Array, "*B E E"]:
        """Return the matrix that maps local deviations to deviations in the world.

        Args:
            layout: Columns of the frame; deviations have the columns of `layout.tangent`.
        """
        points, tangents = _euclidean_columns(layout)
        E = layout.width - len(layout.orientation_starts)
        matrix = np.zeros((*self.A.shape[:-2], E, E)) + np.eye(E)
        matrix[..., tangents[:, None], tangents] = self.A[..., points[:, None], points]
        return matrix


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Frame(_AffineFrame):
    """Coordinate system of an object that does not move: world = A @ local + b.

    Attributes:
        name: Name of the object.
        A: Invertible matrix.
        b: Offset.
        is_moving: False.
    """

    is_moving: ClassVar[bool] = False
    name: str
    A: Float[Array, "D D"]
    b: Float[Array, " D"]

    def at(self, t: int) -> "Frame":
        """Return the frame at a step: the frame itself.

        Args:
            t: Step.
        """
        return self

    def to_local(self, x: Float[Array, "T D"]) -> Float[Array, "T D"]:
        """Return points in local coordinates.

        Args:
            x: Points in world coordinates.
        """
        return np.asarray(np.linalg.solve(self.A, (x - self.b).T).T)

    def validate(self, steps: int, width: int) -> "Frame":
        """Return a read-only copy of the frame if it fits a recording.

        Args:
            steps: Number of rows of the recording.
            width: Number of its columns.

        Raises:
            InvalidInput: If the frame is singular, not finite, or has another number of columns.
        """
        checked = frame(self.name, self.A, self.b)
        _require_width(checked, width)
        return checked

    def resample(self, rows: Float[Array, " S"], layout: Layout) -> "Frame":
        """Return the frame at other times: the frame itself.

        Args:
            rows: Times, in steps.
            layout: Columns of the frame.
        """
        return self

    def differentiate(self, x: Float[Array, "T D"], layout: Layout, period: float) -> "Frame":
        """Return the frame of points followed by their derivatives.

        Args:
            x: Points in world coordinates.
            layout: Their columns, without derivatives.
            period: Time between two rows [s].
        """
        D, rates = len(self.b), self.tangent_map(layout)
        A = np.zeros((D + len(rates),) * 2)
        A[:D, :D], A[D:, D:] = self.A, rates
        return Frame(self.name, A, np.append(self.b, np.zeros(len(rates))))


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MovingFrame(_AffineFrame):
    """Coordinate system of an object that moves, such as a conveyor belt: one A and one b per step.

    Attributes:
        name: Name of the object.
        A: Invertible matrices.
        b: Offsets.
        is_moving: True.
    """

    is_moving: ClassVar[bool] = True
    name: str
    A: Float[Array, "T D D"]
    b: Float[Array, "T D"]

    def at(self, t: int) -> Frame:
        """Return the frame at a step.

        Args:
            t: Step, from 0.
        """
        return Frame(self.name, self.A[t], self.b[t])

    def to_local(self, x: Float[Array, "T D"]) -> Float[Array, "T D"]:
        """Return points in local coordinates, each by the frame of its step.

        Args:
            x: Points in world coordinates, one per step.
        """
        return np.asarray(np.linalg.solve(self.A, (x - self.b)[..., None])[..., 0])

    def validate(self, steps: int, width: int) -> "MovingFrame":
        """Return a read-only copy of the frame if it fits a recording.

        Args:
            steps: Number of rows of the recording.
            width: Number of its columns.

        Raises:
            InvalidInput: If the frame is singular, not finite, or has another number of steps or columns.
        """
        checked = moving_frame(self.name, self.A, self.b)
        _require_width(checked, width)
        if len(checked.b) != steps:
            raise InvalidInput(f"moving frame {self.name!r} has {len(checked.b)} steps, expected {steps}")
        return checked

    def resample(self, rows: Float[Array, " S"], layout: Layout) -> "MovingFrame":
        """Return the frame at other times, interpolated linearly.

        Args:
            rows: Times, in steps; they need not be whole numbers.
            layout: Columns of the frame.
        """
        A = interpolate(self.A, rows)
        for start in layout.orientation_starts:
            # The block of an orientation is given by the quaternion in its first column.
            q = interpolate(unwrap_quaternions(self.A[:, start : start + 4, start]), rows)
            A[:, start : start + 4, start : start + 4] = left_multiplication_matrix(normalise(q))
        return MovingFrame(self.name, A, interpolate(self.b, rows))

    def differentiate(self, x: Float[Array, "T D"], layout: Layout, period: float) -> "MovingFrame":
        """Return the frame of points followed by their derivatives, as at the head of this file.

        Args:
            x: Points in world coordinates, one per step.
            layout: Their columns, without derivatives.
            period: Time between two rows [s].
        """
        T, D = self.b.shape
        next_row = np.minimum(np.arange(T) + 1, T - 1)
        points, tangents = _euclidean_columns(layout)
        rates, starts = self.tangent_map(layout)[next_row], layout.orientation_starts
        A = np.zeros((T, D + rates.shape[1], D + rates.shape[1]))
        A[:, :D, :D], A[:, D:, D:] = self.A, rates
        A[:, D + tangents[:, None], points] = forward_differences(self.A, period)[:, points[:, None], points]
        # World and local angular velocity differ by the angular velocity of the frame in body axes.
        local = self.to_local(x)
        b = tangent_differences(x, starts, period) - tangent_differences(local, starts, period)
        b[:, tangents] = forward_differences(self.b, period)[:, points]
        return MovingFrame(self.name, A, np.hstack([self.b, b]))


def frame(name: str, A: object, b: object) -> Frame:
    """Create a frame from a matrix and an offset: world = A @ local + b.

    Args:
        name: Name of the object.
        A: Invertible matrix of shape (D, D).
        b: Offset of shape (D,).

    Raises:
        InvalidInput: If the shapes differ, a number is not finite or too large, or A is singular.
    """
    label = f"frame {require_name(name, 'the name of a frame')!r}"
    matrix, offset = finite_array(A, f"{label}: A"), finite_array(b, f"{label}: b")
    _require_invertible(label, matrix, offset, leading=())
    return Frame(name, matrix, offset)


def moving_frame(name: str, A: object, b: object) -> MovingFrame:
    """Create a moving frame from one matrix and one offset per step.

    Args:
        name: Name of the object.
        A: Invertible matrices of shape (T, D, D).
        b: Offsets of shape (T, D).

    Raises:
        InvalidInput: As `frame`; the message gives the step.
    """
    label = f"moving frame {require_name(name, 'the name of a frame')!r}"
    matrices, offsets = finite_array(A, f"{label}: A"), finite_array(b, f"{label}: b")
    _require_invertible(label, matrices, offsets, leading=matrices.shape[:1])
    return MovingFrame(name, matrices, offsets)


def world_frame(width: int) -> Frame:
    """Return the frame in which local and world coordinates are the same.

    Args:
        width: Number of columns.
    """
    columns = require_count(width, "width", MAX_COLUMNS, minimum=1)
    return Frame(WORLD, np.eye(columns), np.zeros(columns))


def interpolate(values: Float[Array, "T ..."], rows: Float[Array, " S"]) -> Float[Array, "S ..."]:
    """Return values at rows that need not be whole numbers, interpolated linearly."""
    before = np.minimum(rows.astype(int), len(values) - 2)
    fraction = (rows - before).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - fraction) * values[before] + fraction * values[before + 1])


def _euclidean_columns(layout: Layout) -> tuple[Int[Array, " F"], Int[Array, " F"]]:
    """Return the columns outside orientations on S^3, among points and among deviations."""
    slices = [
        (columns, tangents)
        for columns, tangents, is_orientation in tangent_slices(layout.width, layout.orientation_starts)
        if not is_orientation
    ]
    points = [c for columns, _ in slices for c in range(columns.start, columns.stop)]
    deviations = [c for _, tangents in slices for c in range(tangents.start, tangents.stop)]
    return np.array(points, dtype=np.int64), np.array(deviations, dtype=np.int64)


def _require_width(given: Frame | MovingFrame, width: int) -> None:
    if (columns := given.b.shape[-1]) != width:
        raise InvalidInput(f"frame {given.name!r} has {columns} columns, expected {width}")


def _require_magnitudes(label: str, A: Float[Array, "*B D D"], b: Float[Array, "*B D"]) -> None:
    float_array(A, f"{label}: A", maximum=MAX_SCALE)
    float_array(b, f"{label}: b", maximum=MAX_OFFSET)
    smallest = float(np.abs(A).max(axis=(-2, -1), initial=0.0).min(initial=MAX_SCALE))
    if 0.0 < smallest < MIN_SCALE:  # 0 is refused as singular
        raise InvalidInput(
            f"{label}: the largest entry of A is {smallest:g}, expected at least {MIN_SCALE:g}; choose "
            "another unit for the local coordinates"
        )


def _require_invertible(
    label: str, A: Float[Array, "..."], b: Float[Array, "..."], leading: tuple[int, ...]
) -> None:
    D = A.shape[-1] if A.ndim else 0
    if D == 0 or A.shape != (*leading, D, D) or b.shape != (*leading, D):
        steps = "T, " if leading else ""
        raise InvalidInput(
            f"{label}: A has shape {A.shape} and b {b.shape}, expected A ({steps}D, D) and b ({steps}D)"
        )
    _require_magnitudes(label, A, b)
    if A.size and np.abs(A.swapaxes(-2, -1) @ A - np.eye(D)).max() < 0.1 / D:  # nearly orthogonal: below 1.2
        return
    conditions = np.atleast_1d(np.linalg.cond(A))
    if (bad := np.flatnonzero(~(conditions < MAX_CONDITION))).size:
        step = f" at step {bad[0]} (first is 0)" if leading else ""
        raise InvalidInput(
            f"{label}: A{step} is singular (condition {conditions[bad[0]]:.3g}), expected an invertible "
            "matrix such as that of frame_from_pose"
        )
