"""Resampling of a recording to another number of rows."""

import numpy as np

from pilotfish.demonstrations.frames import interpolate
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.signs import unwrap_orientations
from pilotfish.demonstrations.switches import switching_columns
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float


def resample(demo: Demonstration, steps: int) -> Demonstration:
    """Resample a demonstration to another number of rows over the same time; the period changes.

    Points are interpolated linearly and quaternions are then normalised: between two rows, the difference
    from slerp is far below the noise of a recording. On S^3 the nearer of q and -q is used. Derivatives are
    interpolated like other columns. For x[t+1] = x[t] + period v[t] to hold exactly, resample first and call
    `add_derivatives` afterwards. Moving frames are interpolated entry by entry.

    Columns that switch between two values, such as a gripper's command, take the value of the nearest row,
    and their derivative is the difference to the next row, so that no switch is lost or becomes a ramp.

    Args:
        demo: Demonstration.
        steps: Number of rows, at least 2.

    Returns:
        The resampled demonstration.

    Raises:
        InvalidInput: If steps is below 2, or a frame rotates by so much from one row to the next that it is
            singular in between.
    """
    if steps < 2:
        raise InvalidInput(f"steps is {steps}, expected 2 or more")
    rows = np.linspace(0, len(demo.x) - 1, steps)
    x = interpolate(unwrap_orientations(demo.x, demo.layout), rows)
    for columns in demo.layout.unit_quaternions:
        x[:, columns] /= np.linalg.norm(x[:, columns], axis=1, keepdims=True)
    period = demo.period * (len(demo.x) - 1) / (steps - 1)
    _resample_switches(x, demo, rows, period)
    frames = [frame.resample(rows, demo.layout) for frame in demo.frames]
    return demonstration(x, period, demo.layout, frames, demo.name)


def _resample_switches(
    x: Float[Array, "S D"], demo: Demonstration, rows: Float[Array, " S"], period: float
) -> None:
    """Give the columns that switch, and their derivatives, their values in place."""
    nearest, layout = rows.round().astype(int), demo.layout
    for name in switching_columns(demo.x, layout):
        column = layout.names.index(name)
        x[:, column] = demo.x[nearest, column]
        if (rate := layout.rate_column(column)) is not None:
            x[:, rate] = np.diff(x[:, column], append=x[-1:, column]) / period
