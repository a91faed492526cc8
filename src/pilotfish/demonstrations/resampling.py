"""The same movement in more or fewer rows."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.signs import without_flips
from pilotfish.errors import InvalidInput
from pilotfish.geometry import continuous, left_matrix, normalise
from pilotfish.types import Array, Float


def resampled(demo: Demonstration, steps: int) -> Demonstration:
    """The same movement over the same time in so many rows: linear in between, the period changes.

    Orientations are interpolated linearly and divided by their norm (not slerp: between two rows of a
    recording the difference is far below its noise); on S^3, of q and -q the nearer is taken. Derivatives are
    interpolated as they are, so they stay speeds; for x[t+1] = x[t] + period v[t] to hold again, resample
    first and call with_derivatives after.
    Moving frames are interpolated entry by entry.
    Raises: InvalidInput, for fewer than two steps, or when a frame turns so far from one row to the next that
    it is singular in between.
    """
    if steps < 2:
        raise InvalidInput(f"steps is {steps}, expected 2 or more")
    rows, turns = np.linspace(0, len(demo.x) - 1, steps), demo.layout.turns
    x = _between(without_flips(demo.x, turns), rows)
    for start in sorted([*turns, *(columns.start for columns in demo.layout.quaternions)]):
        x[:, start : start + 4] /= np.linalg.norm(x[:, start : start + 4], axis=1, keepdims=True)
    period = demo.period * (len(demo.x) - 1) / (steps - 1)
    frames = [_resampled_frame(given, rows, turns) for given in demo.frames]
    return demonstration(x, period, demo.layout, frames, demo.name)


def _resampled_frame(
    given: Frame | MovingFrame, rows: Float[Array, " S"], turns: tuple[int, ...]
) -> Frame | MovingFrame:
    if isinstance(given, Frame):
        return given
    A = _between(given.A, rows)
    for start in turns:  # a block that turns an orientation is told by the quaternion in its first column
        q = _between(continuous(given.A[:, start : start + 4, start]), rows)
        A[:, start : start + 4, start : start + 4] = left_matrix(normalise(q))
    return MovingFrame(given.name, A, _between(given.b, rows))


def _between(values: Float[Array, "T ..."], rows: Float[Array, " S"]) -> Float[Array, "S ..."]:
    """Values at rows that need not be whole numbers."""
    before = np.minimum(rows.astype(int), len(values) - 2)
    share = (rows - before).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[before] + share * values[before + 1])
