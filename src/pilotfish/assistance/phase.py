"""Phase of a demonstration, from 0 at its start to 1 at its end, and demonstrations with a phase column.

    logistic  s(t) = (f(t) - f(0)) / (f(1) - f(0)), f(t) = 1 / (1 + exp(-a (2 t - 1))), t the
              share of the time
    path      share of the path length, in which every part is divided by its scale

With the share of the time itself the derivative of the pose by the phase vanishes at the start and at the
end, where the hand is slow. The logistic function is slow there as well. With the path length this
derivative has a constant length, and pauses have no extent.
"""

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
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import log_map
from pilotfish.types import Array, Float, Int
from pilotfish.validation import finite_array, require_type

PHASE = "phase"
STEEPNESS = 3.0  # a: the logistic phase starts and ends at 0.3 of its mean rate
PHASE_PART = Part(PHASE, Quantity.SCALAR, 1, "1")


def logistic_phase(steps: int) -> Float[Array, " T"]:
    """Return the logistic phase of evenly sampled steps.

    Args:
        steps: Number of steps, at least two.
    """
    f = 1.0 / (1.0 + np.exp(-STEEPNESS * np.linspace(-1.0, 1.0, steps)))
    return np.asarray((f - f[0]) / (f[-1] - f[0]))


def path_phase(
    x: Float[Array, "T D"], scales: Float[Array, " E"], orientation_starts: tuple[int, ...]
) -> Float[Array, " T"]:
    """Return the share of the path length.

    Args:
        x: Points of a demonstration.
        scales: Scale of each tangent column; infinite for columns that do not count.
        orientation_starts: First column of each unit quaternion.

    Raises:
        InvalidInput: If the points are all the same.
    """
    lengths = np.linalg.norm(log_map(x[:-1], x[1:], orientation_starts) / scales, axis=1)
    total = np.append(0.0, lengths.cumsum())
    if not total[-1] > 0.0:
        raise InvalidInput("a demonstration does not move, expected a path of positive length; leave it out")
    return np.asarray(total / total[-1])


def sphere_layout(layout: Layout) -> Layout:
    """Return the layout with every quaternion as a point of S^3, so that deviations are rotation vectors."""
    parts = [
        replace(part, quantity=Quantity.ORIENTATION) if part.quantity is Quantity.QUATERNION else part
        for part in layout.parts
    ]
    return Layout(tuple(parts))


def coordinate_layout(layout: Layout) -> Layout:
    """Return the parts of a layout that are not derivatives.

    Args:
        layout: Columns of a recording.
    """
    return Layout(tuple(part for part in layout.parts if not part.derivative))


def select_columns(frame: Frame | MovingFrame, columns: Int[Array, " C"]) -> Frame | MovingFrame:
    """Return the frame of some of its columns, on which the others have no effect.

    Args:
        frame: Frame of a recording.
        columns: Columns to keep.
    """
    return replace(frame, A=frame.A[..., columns[:, None], columns], b=frame.b[..., columns])


def add_phase(demo: Demonstration, phase: Float[Array, " T"]) -> Demonstration:
    """Return a demonstration with the phase as its last column, which no frame changes.

    Args:
        demo: Demonstration without derivatives.
        phase: Phase of each step.

    Raises:
        InvalidInput: If the demonstration has derivatives or a phase, or the phase is not a finite number for
            each of its steps.
    """
    require_type(demo, "demo", Demonstration, "create one with pf.demonstration")
    if derived := [part.name for part in demo.layout.parts if part.derivative]:
        raise InvalidInput(
            f"demo has a derivative of {derived[0]!r}, expected none; give it before add_derivatives"
        )
    if any(part.name == PHASE for part in demo.layout.parts):
        raise InvalidInput(f"demo has a part {PHASE!r} already, expected none; rename it")
    s = finite_array(phase, "phase", (len(demo.x),))
    frames = [_add_scalar(frame) for frame in demo.frames]
    layout = Layout((*demo.layout.parts, PHASE_PART))
    return demonstration(np.column_stack([demo.x, s]), demo.period, layout, frames, demo.name)


def _add_scalar(frame: Frame | MovingFrame) -> Frame | MovingFrame:
    D = frame.b.shape[-1]
    A = np.zeros((*frame.A.shape[:-2], D + 1, D + 1))
    A[..., :D, :D], A[..., D, D] = frame.A, 1.0
    return replace(frame, A=A, b=np.concatenate([frame.b, np.zeros((*frame.b.shape[:-1], 1))], axis=-1))
