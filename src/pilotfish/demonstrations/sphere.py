"""Conversion of quaternions from four numbers in R^4 to points of S^3."""

from dataclasses import replace

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.layouts import ROTATION_VECTOR_SIZE, Layout, Part, Quantity
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.geometry import conjugate, multiply, normalise
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type, short_list

BLOCK_TOLERANCE = 1e-4  # between the matrices by which a frame rotates a quaternion and its derivative


def to_sphere(demo: Demonstration) -> Demonstration:
    """Treat the quaternions of a demonstration as points of S^3 instead of four numbers in R^4.

    Their differences are then rotation vectors [rad], and q and -q are one point. The derivative of a
    quaternion becomes the angular velocity 2 q* q' in body axes [rad/s]. Frames multiply orientations as
    before and leave angular velocities unchanged; in a moving frame, angular velocities are relative to it.

    Args:
        demo: Demonstration with at least one quaternion.

    Returns:
        The converted demonstration.

    Raises:
        InvalidInput: If the layout has no quaternion, one has a second derivative or a derivative without
            itself, or a frame rotates a quaternion and its derivative differently.
    """
    require_type(demo, "demo", Demonstration, "create one with pf.demonstration; convert a list one by one")
    layout = _sphere_layout(demo.layout)
    x = _manifold_points(demo.x, demo.layout)
    frames = [_convert_frame(given, demo, x) for given in demo.frames]
    return demonstration(x, demo.period, layout, frames, demo.name)


def _sphere_layout(layout: Layout) -> Layout:
    if not layout.unit_quaternions:
        raise InvalidInput(
            f"the columns are {short_list(layout.names)}, expected a quaternion among them to put on S^3"
        )
    orientations = {
        part.name for part in layout.parts if part.quantity is Quantity.QUATERNION and not part.derivative
    }
    for part in layout.parts:
        if part.quantity is Quantity.QUATERNION and (part.derivative > 1 or part.name not in orientations):
            raise InvalidInput(
                f"part {part.name!r} is derivative {part.derivative} of a quaternion, expected the "
                "quaternion itself and at most its first derivative; drop the others"
            )
    return Layout(tuple(_convert_part(part) for part in layout.parts))


def _convert_part(part: Part) -> Part:
    if part.quantity is not Quantity.QUATERNION:
        return part
    if part.derivative:
        return replace(part, quantity=Quantity.SCALAR, size=ROTATION_VECTOR_SIZE, unit="rad/s")
    return replace(part, quantity=Quantity.ORIENTATION)


def _manifold_points(x: Float[Array, "T D"], layout: Layout) -> Float[Array, "T E"]:
    """Normalise quaternions and convert their derivatives to angular velocities."""
    blocks = []
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        block = x[:, columns]
        if part.quantity is Quantity.QUATERNION:
            q = normalise(x[:, layout.columns(part.name)])
            block = 2.0 * multiply(conjugate(q), block)[:, 1:] if part.derivative else q
        blocks.append(block)
    return np.hstack(blocks)


def _convert_frame(
    given: Frame | MovingFrame, demo: Demonstration, x: Float[Array, "T E"]
) -> Frame | MovingFrame:
    columns, target_columns, rates = _unchanged_and_rate_columns(demo.layout)
    E = x.shape[1]
    A, b = np.zeros((*given.A.shape[:-2], E, E)) + np.eye(E), np.zeros((*given.b.shape[:-1], E))
    A[..., target_columns[:, None], target_columns] = given.A[..., columns[:, None], columns]
    b[..., target_columns] = given.b[..., columns]
    if given.is_moving:  # add the angular velocity of the frame
        b[:, rates] = (x - _manifold_points(given.to_local(demo.x), demo.layout))[:, rates]
    else:
        _require_same_rotation(given, demo.layout)
    return replace(given, A=A, b=b)


def _unchanged_and_rate_columns(
    layout: Layout,
) -> tuple[Int[Array, " F"], Int[Array, " F"], Int[Array, " R"]]:
    """Return the columns that stay, where they go, and the columns of angular velocities."""
    stays = [not (part.quantity is Quantity.QUATERNION and part.derivative) for part in layout.parts]
    before = np.repeat(stays, [part.size for part in layout.parts])
    after = np.repeat(stays, [part.size for part in _sphere_layout(layout).parts])
    return np.flatnonzero(before), np.flatnonzero(after), np.flatnonzero(~after)


def _require_same_rotation(given: Frame | MovingFrame, layout: Layout) -> None:
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION and part.derivative:
            quaternion = layout.columns(part.name)
            difference = np.abs(given.A[columns, columns] - given.A[quaternion, quaternion]).max()
            if difference > BLOCK_TOLERANCE:
                raise InvalidInput(
                    f"frame {given.name!r} rotates {part.name!r} and its derivative differently, by "
                    f"{difference:.3g}, expected the same matrix for both; see frame_from_pose"
                )
