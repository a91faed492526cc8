"""The doors for frames: arrays of the right size that can be looked back through, or InvalidInput."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame, require_magnitudes
from pilotfish.demonstrations.layouts import require_name
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array

MAX_CONDITION = 1e12  # beyond it, float64 leaves fewer than four digits of what is seen


def frame(name: str, A: object, b: object) -> Frame:
    """A frame from its matrix and offset: world = A @ seen + b.

    Raises: InvalidInput, when A is not square, b is not as long, a number is not finite, or A is singular.
    """
    label = f"frame {require_name(name, 'a frame')!r}"
    matrix, offset = finite_array(A, f"{label}: A"), finite_array(b, f"{label}: b")
    _require_shapes(label, matrix, offset, leading=())
    require_magnitudes(label, matrix, offset)
    _require_invertible(label, matrix[None], moving=False)
    return Frame(name, matrix, offset)


def moving_frame(name: str, A: object, b: object) -> MovingFrame:
    """A frame for each step from matrices (T, D, D) and offsets (T, D).

    Raises: InvalidInput, as frame does, naming the step.
    """
    label = f"moving frame {require_name(name, 'a frame')!r}"
    matrices, offsets = finite_array(A, f"{label}: A"), finite_array(b, f"{label}: b")
    _require_shapes(label, matrices, offsets, leading=matrices.shape[:1])
    require_magnitudes(label, matrices, offsets)
    _require_invertible(label, matrices, moving=True)
    return MovingFrame(name, matrices, offsets)


def _require_shapes(
    label: str, A: Float[Array, "..."], b: Float[Array, "..."], *, leading: tuple[int, ...]
) -> None:
    D = A.shape[-1] if A.ndim else 0
    if D == 0 or A.shape != (*leading, D, D) or b.shape != (*leading, D):
        steps = "T, " if leading else ""
        raise InvalidInput(
            f"{label}: A has shape {A.shape} and b {b.shape}, expected A ({steps}D, D) and b ({steps}D)"
        )


def _require_invertible(label: str, A: Float[Array, "T D D"], *, moving: bool) -> None:
    conditions = np.linalg.cond(A)
    if (bad := np.flatnonzero(~(conditions < MAX_CONDITION))).size:
        step = f" at step {bad[0]} (first is 0)" if moving else ""
        raise InvalidInput(
            f"{label}: A{step} is singular (condition {conditions[bad[0]]:.3g}), expected an invertible one "
            "such as that of frame_from_pose"
        )
