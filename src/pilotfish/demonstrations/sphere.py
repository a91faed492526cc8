"""From quaternions as four numbers to orientations as points of the sphere S^3."""

from dataclasses import replace

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.layouts import ROTATION_VECTOR_SIZE, Layout, Part, Quantity
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.geometry import conjugate, multiply, normalise
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type, short_list

BLOCK_TOLERANCE = 1e-4  # between the matrices by which a frame turns a quaternion and its derivative


def to_sphere(demo: Demonstration) -> Demonstration:
    """The same movement with its quaternions as points of S^3: no sign, no length, differences in radians.

    The derivative of a quaternion becomes the angular velocity 2 q* q' [rad/s] in the axes of the body.
    Frames turn orientations as before and leave angular velocities as they are; from a frame that moves,
    those are seen relative to it.
    Raises: InvalidInput, when there is no quaternion, when one has a second derivative or a derivative
    without itself, or when a frame turns a quaternion and its derivative differently.
    """
    require_type(demo, "demo", Demonstration, "pf.demonstration makes one of an array; of a list, one by one")
    layout = _layout(demo.layout)
    x = _manifold_points(demo.x, demo.layout)
    frames = [_frame(given, demo, x) for given in demo.frames]
    return demonstration(x, demo.period, layout, frames, demo.name)


def _layout(layout: Layout) -> Layout:
    if not layout.quaternions and not layout.orientation_starts:
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
    """Quaternions of length one, their derivatives as angular velocities."""
    parts = []
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        piece = x[:, columns]
        if part.quantity is Quantity.QUATERNION:
            q = normalise(x[:, layout.columns(part.name)])
            piece = 2.0 * multiply(conjugate(q), piece)[:, 1:] if part.derivative else q
        parts.append(piece)
    return np.hstack(parts)


def _frame(given: Frame | MovingFrame, demo: Demonstration, x: Float[Array, "T E"]) -> Frame | MovingFrame:
    columns, target_columns, rates = _columns(demo.layout)
    E = x.shape[1]
    A, b = np.zeros((*given.A.shape[:-2], E, E)) + np.eye(E), np.zeros((*given.b.shape[:-1], E))
    A[..., target_columns[:, None], target_columns] = given.A[..., columns[:, None], columns]
    b[..., target_columns] = given.b[..., columns]
    if isinstance(given, Frame):
        _require_same_rotation(given, demo.layout)
        return Frame(given.name, A, b)
    local = np.linalg.solve(given.A, (demo.x - given.b)[..., None])[..., 0]
    b[:, rates] = (x - _manifold_points(local, demo.layout))[:, rates]  # what the frame's own turning adds
    return MovingFrame(given.name, A, b)


def _columns(layout: Layout) -> tuple[Int[Array, " F"], Int[Array, " F"], Int[Array, " R"]]:
    """Columns that stay what they are, where they go, and where angular velocities are."""
    kept_parts = [not (part.quantity is Quantity.QUATERNION and part.derivative) for part in layout.parts]
    before = np.repeat(kept_parts, [part.size for part in layout.parts])
    after = np.repeat(kept_parts, [part.size for part in _layout(layout).parts])
    return np.flatnonzero(before), np.flatnonzero(after), np.flatnonzero(~after)


def _require_same_rotation(given: Frame, layout: Layout) -> None:
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION and part.derivative:
            itself = layout.columns(part.name)
            apart = np.abs(given.A[columns, columns] - given.A[itself, itself]).max()
            if apart > BLOCK_TOLERANCE:
                raise InvalidInput(
                    f"frame {given.name!r} turns {part.name!r} and its derivative differently, by "
                    f"{apart:.3g}, expected the same matrix for both; see frame_from_pose"
                )
