"""Coordinate systems that a movement is seen from: where the objects of the task stood."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    Pose,
    left_multiplication_matrix,
    rotation_matrix,
    tangent_slices,
    unwrap_quaternions,
)
from pilotfish.types import Array, Float, Int
from pilotfish.validation import float_array, require_count

WORLD = "world"
MAX_COLUMNS = 10_000
SPATIAL_AXES = 3  # axes of the space that poses live in
MIN_SCALE, MAX_SCALE, MAX_OFFSET = 1e-20, 1e20, 1e50  # of A and of b; covariances take squares
ROTATION_TOLERANCE = 1e-4  # a published rotation matrix carries about six digits


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """world = A @ seen + b. A is invertible."""

    name: str
    A: Float[Array, "D D"]
    b: Float[Array, " D"]


@dataclass(frozen=True, slots=True, eq=False)
class MovingFrame:
    """A frame for each step: the hand that offers the cup, a conveyor belt."""

    name: str
    A: Float[Array, "T D D"]
    b: Float[Array, "T D"]

    def at(self, t: int) -> Frame:
        return Frame(self.name, self.A[t], self.b[t])


def require_magnitudes(label: str, A: Float[Array, "*B D D"], b: Float[Array, "*B D"]) -> None:
    """Check that a frame can carry means and covariances without overflow.

    Raises:
        InvalidInput: If A or b is not finite, an entry of A exceeds 1e20 or one of b 1e50, or all entries of
            A are below 1e-20.
    """
    float_array(A, f"{label}: A", maximum=MAX_SCALE)
    float_array(b, f"{label}: b", maximum=MAX_OFFSET)
    sizes = np.abs(A).max(axis=(-2, -1), initial=0.0)
    smallest = float(sizes.min(initial=MAX_SCALE))
    if 0.0 < smallest < MIN_SCALE:  # 0 is refused as singular
        raise InvalidInput(
            f"{label}: A has no entry beyond {smallest:g}, expected at least {MIN_SCALE:g}; choose "
            "another unit for what the frame sees"
        )


def world_frame(width: int) -> Frame:
    """The frame from which everything looks as it was recorded."""
    columns = require_count(width, "width", MAX_COLUMNS, minimum=1)
    return Frame(WORLD, np.eye(columns), np.zeros(columns))


def is_world(given: Frame | MovingFrame) -> bool:
    """Whether everything looks as it was recorded, whatever the frame is called."""
    return isinstance(given, Frame) and np.array_equal(given.A, np.eye(len(given.b))) and not given.b.any()


def frame_from_pose(name: str, layout: Layout, pose: Pose) -> Frame:
    """The frame of an object that stands in this pose (world from object).

    Positions turn and move with it, vectors turn, quaternions are multiplied from the left, scalars stay;
    derivatives do the same without the move.
    Raises: InvalidInput, when a position or vector of the layout has other than three axes.
    Source: Tanwani 2018, eq. 3.57.
    """
    moving = moving_frame_from_poses(name, layout, (pose,))
    return moving.at(0)


def moving_frame_from_poses(name: str, layout: Layout, poses: Sequence[Pose]) -> MovingFrame:
    """As frame_from_pose, one pose for each step; quaternions may flip sign, being poses."""
    _require_three_axes(name, layout)
    label = f"frame {name!r}: position"
    positions = np.stack([float_array(pose.position, label, SPATIAL_AXES, MAX_OFFSET) for pose in poses])
    quaternions = unwrap_quaternions(
        np.stack([float_array(pose.quaternion, "quaternion", 4, 2.0) for pose in poses])
    )
    A = np.zeros((len(poses), layout.width, layout.width))
    b = np.zeros((len(poses), layout.width))
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        A[:, columns, columns] = _block(part, quaternions)
        if part.quantity is Quantity.POSITION and part.derivative == 0:
            b[:, columns] = positions
    return MovingFrame(name, A, b)


def _block(part: Part, quaternions: Float[Array, "T 4"]) -> Float[Array, "T d d"]:
    match part.quantity:
        case Quantity.POSITION | Quantity.VECTOR:
            return rotation_matrix(quaternions)
        case Quantity.QUATERNION | Quantity.ORIENTATION:
            return left_multiplication_matrix(quaternions)
        case Quantity.SCALAR:
            return np.broadcast_to(np.eye(part.size), (len(quaternions), part.size, part.size))


def _require_three_axes(name: str, layout: Layout) -> None:
    spatial = (Quantity.POSITION, Quantity.VECTOR)
    for part in layout.parts:
        if part.quantity in spatial and part.size != SPATIAL_AXES:
            raise InvalidInput(
                f"frame {name!r}: part {part.name!r} has {part.size} axes, expected 3 to turn it by a pose; "
                "give A and b of the frame instead: frame(name, A, b)"
            )


def tangent_map(A: Float[Array, "*B D D"], orientation_starts: tuple[int, ...]) -> Float[Array, "*B E E"]:
    """How frames with these matrices carry deviations: as they carry differences, but for orientations.

    Those stay: a frame multiplies an orientation from the left, and body axes turn with the body.
    """
    flat, tangents, E = (
        *euclidean_columns(A.shape[-1], orientation_starts),
        A.shape[-1] - len(orientation_starts),
    )
    carried = np.zeros((*A.shape[:-2], E, E)) + np.eye(E)
    carried[..., tangents[:, None], tangents] = A[..., flat[:, None], flat]
    return carried


def euclidean_columns(
    width: int, orientation_starts: tuple[int, ...]
) -> tuple[Int[Array, " F"], Int[Array, " F"]]:
    """The columns that belong to no orientation, among those of points and among those of deviations."""
    flat = [(here, there) for here, there, turn in tangent_slices(width, orientation_starts) if not turn]
    points = [column for here, _ in flat for column in range(here.start, here.stop)]
    tangents = [column for _, there in flat for column in range(there.start, there.stop)]
    return np.array(points, dtype=np.int64), np.array(tangents, dtype=np.int64)


def require_left_multiplication(
    label: str, A: Float[Array, "*B D D"], b: Float[Array, "*B D"], orientation_starts: tuple[int, ...]
) -> None:
    """Nothing, when each orientation on S^3 is multiplied from the left by a unit quaternion and no more.

    Raises: InvalidInput otherwise: whatever else a frame did to it would not stay on S^3.
    """
    for start in orientation_starts:
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
                f"{label}: columns {start} to {start + 3} are an orientation on S^3, and A and b differ by "
                f"{worst:.3g} from multiplying it by a unit quaternion from the left, expected at most "
                f"{ROTATION_TOLERANCE:g}; see frame_from_pose"
            )
