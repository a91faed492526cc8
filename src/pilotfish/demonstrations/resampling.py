"""The same movement in more or fewer rows."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.signs import unwrap_orientation_starts
from pilotfish.errors import InvalidInput
from pilotfish.geometry import left_multiplication_matrix, normalise, unwrap_quaternions
from pilotfish.types import Array, Float


def resample(demo: Demonstration, steps: int) -> Demonstration:
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
    rows, orientation_starts = np.linspace(0, len(demo.x) - 1, steps), demo.layout.orientation_starts
    x = _interpolate(unwrap_orientation_starts(demo.x, orientation_starts), rows)
    for start in sorted([*orientation_starts, *(columns.start for columns in demo.layout.quaternions)]):
        x[:, start : start + 4] /= np.linalg.norm(x[:, start : start + 4], axis=1, keepdims=True)
    period = demo.period * (len(demo.x) - 1) / (steps - 1)
    frames = [_resampled_frame(given, rows, orientation_starts) for given in demo.frames]
    return demonstration(x, period, demo.layout, frames, demo.name)


def _resampled_frame(
    given: Frame | MovingFrame, rows: Float[Array, " S"], orientation_starts: tuple[int, ...]
) -> Frame | MovingFrame:
    if isinstance(given, Frame):
        return given
    A = _interpolate(given.A, rows)
    for start in (
        orientation_starts
    ):  # a block that turns an orientation is told by the quaternion in its first column
        q = _interpolate(unwrap_quaternions(given.A[:, start : start + 4, start]), rows)
        A[:, start : start + 4, start : start + 4] = left_multiplication_matrix(normalise(q))
    return MovingFrame(given.name, A, _interpolate(given.b, rows))


def _interpolate(values: Float[Array, "T ..."], rows: Float[Array, " S"]) -> Float[Array, "S ..."]:
    """Values at rows that need not be whole numbers."""
    before = np.minimum(rows.astype(int), len(values) - 2)
    share = (rows - before).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1 - share) * values[before] + share * values[before + 1])
