"""Pose of a frame in space, and the frame after its object was moved.

A frame maps local to world coordinates by A and b, for all columns of a row. Its pose is where it maps the
first position: the origin is b there, and the rotation the orthogonal factor of A. If an object moves by the
rigid displacement (M, m), its frame becomes x -> M (A x + b) + m. This holds for any A, also with scales.
"""

import numpy as np

from pilotfish.demonstrations import Frame, Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    Pose,
    left_multiplication_matrix,
    pose,
    quaternion_from_rotation_matrix,
    rotation_matrix,
)
from pilotfish.panel.spatial_columns import SPACE, position_part
from pilotfish.types import Array, Float
from pilotfish.validation import require_type


def frame_pose(frame: Frame, layout: Layout) -> Pose:
    """Return the pose of a frame in space.

    Args:
        frame: Frame of an object.
        layout: Columns of the frame.

    Returns:
        Origin and axes. The third axis is reversed if the frame mirrors, since a pose cannot.

    Raises:
        InvalidInput: If the frame has other columns, or the layout has no position.
    """
    _require_frame(frame, layout)
    part, columns = position_part(layout)
    left, _, right = np.linalg.svd(frame.A[columns, columns])
    rotation, origin = np.eye(SPACE), np.zeros(SPACE)
    rotation[: part.size, : part.size] = left @ right
    if np.linalg.det(rotation) < 0.0:
        rotation[:, 2] *= -1.0
    origin[: part.size] = frame.b[columns]
    return Pose(origin, quaternion_from_rotation_matrix(rotation))


def move_frame(frame: Frame, layout: Layout, target: Pose) -> Frame:
    """Return a frame after its object was moved to a pose.

    Positions with as many axes as the first are moved, vectors rotated, orientations multiplied from the
    left, and other columns unchanged. In a plane, objects turn about its normal; on a line they do not turn.

    Args:
        frame: Frame before the motion.
        layout: Columns of the frame.
        target: Pose of the frame after the motion.

    Returns:
        A frame of the same name.

    Raises:
        InvalidInput: If the frame has other columns, or the pose is not finite.
    """
    before = frame_pose(frame, layout)
    require_type(target, "target", Pose, "geometry.pose(position, quaternion) returns one")
    after = pose(target.position, target.quaternion)
    part, _ = position_part(layout)
    turn = _turn(rotation_matrix(after.quaternion) @ rotation_matrix(before.quaternion).T, part.size)
    n = part.size
    shift = after.position[:n] - turn[:n, :n] @ before.position[:n]
    M, m = np.eye(layout.width), np.zeros(layout.width)
    for each, columns in zip(layout.parts, layout.slices, strict=True):
        M[columns, columns] = _block(each, turn, n)
        if each.quantity is Quantity.POSITION and each.size == n and not each.derivative:
            m[columns] = shift
    return Frame(frame.name, M @ frame.A, M @ frame.b + m)


def _require_frame(frame: object, layout: object) -> None:
    require_type(layout, "layout", Layout, "that of a demonstration is demonstration.layout")
    require_type(frame, "frame", Frame, "a moving frame at a step is frame.at(t)")
    assert isinstance(frame, Frame)
    assert isinstance(layout, Layout)
    for value, shape in ((frame.A, (layout.width, layout.width)), (frame.b, (layout.width,))):
        require_type(value, "an array of the frame", np.ndarray, "see demonstrations.frame")
        if value.shape != shape:
            raise InvalidInput(f"frame {frame.name!r} has an array {value.shape}, expected {shape}")
    frame.require_magnitudes()


def _turn(rotation: Float[Array, "3 3"], axes: int) -> Float[Array, "3 3"]:
    """Return the part of a rotation that is possible in a space of one, two or three axes."""
    if axes == SPACE:
        return rotation
    turn = np.eye(SPACE)
    if axes == 2:
        angle = np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn


def _block(part: Part, turn: Float[Array, "3 3"], axes: int) -> Float[Array, "d d"]:
    """Return how a turn changes the columns of a part."""
    match part.quantity:
        case Quantity.POSITION | Quantity.VECTOR if part.size == axes:
            return turn[:axes, :axes]
        case Quantity.QUATERNION | Quantity.ORIENTATION:
            return left_multiplication_matrix(quaternion_from_rotation_matrix(turn))
        case _:
            return np.eye(part.size)
