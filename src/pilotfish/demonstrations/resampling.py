"""The same movement in more or fewer rows."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float


def resampled(demo: Demonstration, steps: int) -> Demonstration:
    """The same movement over the same time in so many rows: linear in between, the period changes.

    Orientations are interpolated linearly and divided by their norm (not slerp: between two rows of a
    recording the difference is far below its noise). Derivatives are interpolated as they are, so they stay
    speeds; for x[t+1] = x[t] + period v[t] to hold again, resample first and call with_derivatives after.
    Moving frames are interpolated entry by entry.
    Raises: InvalidInput, for fewer than two steps, or when a frame turns so far from one row to the next that
    it is singular in between.
    """
    if steps < 2:
        raise InvalidInput(f"steps is {steps}, expected 2 or more")
    rows = np.linspace(0, len(demo.x) - 1, steps)
    x = _between(demo.x, rows)
    for columns in demo.layout.quaternions:
        x[:, columns] /= np.linalg.norm(x[:, columns], axis=1, keepdims=True)
    period = demo.period * (len(demo.x) - 1) / (steps - 1)
    frames = [_resampled_frame(given, rows) for given in demo.frames]
    return demonstration(x, period, demo.layout, frames, demo.name)


def _resampled_frame(given: Frame | MovingFrame, rows: Float[Array, " S"]) -> Frame | MovingFrame:
    if isinstance(given, Frame):
        return given
    return MovingFrame(given.name, _between(given.A, rows), _between(given.b, rows))


def _between(values: Float[Array, "T ..."], rows: Float[Array, " S"]) -> Float[Array, "S ..."]:
    """Values at rows that need not be whole numbers."""
    before = np.minimum(rows.astype(int), len(values) - 2)
    share = (rows - before).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[before] + share * values[before + 1])
