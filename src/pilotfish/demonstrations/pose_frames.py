"""Frames of objects from their poses."""

from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations.frames import MAX_OFFSET, Frame, MovingFrame, frame
from pilotfish.demonstrations.layouts import Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, left_multiplication_matrix, rotation_matrix, unwrap_quaternions
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, float_array, require_number, require_type

SPATIAL_AXES, PLANAR_AXES = 3, 2  # axes of the space that poses live in


def frame_from_pose(name: str, layout: Layout, pose: Pose) -> Frame:
    """Create the frame of an object from its pose.

    Args:
        name: Name of the object.
        layout: Columns of the recording; positions and vectors must have three axes.
        pose: world_from_object.

    Raises:
        InvalidInput: If a position or vector of the layout has another number of axes.

    Source:
        Tanwani 2018, eq. 3.57.
    """
    return moving_frame_from_poses(name, layout, (pose,)).at(0)


def planar_frame(name: str, layout: Layout, position: Float[Array, " 2"], angle: float) -> Frame:
    """Create the frame of an object that moves and turns in the plane.

    Args:
        name: Name of the object.
        layout: Columns of the recording; positions and vectors must have two axes, and no part is a
            quaternion.
        position: Origin of the object [m].
        angle: Angle from the world's x axis to the object's [rad].

    Raises:
        InvalidInput: If a part has another number of axes, or a value is not finite.
    """
    require_type(layout, "layout", Layout, "create one with demonstrations.position_layout(2)")
    origin = finite_array(position, f"frame {name!r}: position", (PLANAR_AXES,), MAX_OFFSET)
    c, s = np.cos(require_number(angle, "angle")), np.sin(angle)
    A, b = np.eye(layout.width), np.zeros(layout.width)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.SCALAR:
            continue
        if part.quantity not in (Quantity.POSITION, Quantity.VECTOR) or part.size != PLANAR_AXES:
            raise InvalidInput(
                f"frame {name!r}: part {part.name!r} has {part.size} columns, expected positions and vectors "
                "of two axes; give a pose with three axes: frame_from_pose(name, layout, pose)"
            )
        A[columns, columns] = [[c, -s], [s, c]]
        if part.quantity is Quantity.POSITION and part.derivative == 0:
            b[columns] = origin
    return frame(name, A, b)


def moving_frame_from_poses(name: str, layout: Layout, poses: Sequence[Pose]) -> MovingFrame:
    """Create the frame of a moving object from one pose per step.

    Args:
        name: Name of the object.
        layout: Columns of the recording; positions and vectors must have three axes.
        poses: world_from_object at each step; quaternions may change sign.

    Raises:
        InvalidInput: As `frame_from_pose`.
    """
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
    for part in layout.parts:
        if part.quantity in (Quantity.POSITION, Quantity.VECTOR) and part.size != SPATIAL_AXES:
            raise InvalidInput(
                f"frame {name!r}: part {part.name!r} has {part.size} axes, expected 3 to rotate it by a "
                "pose; see planar_frame, or pass A and b: frame(name, A, b)"
            )
