"""Resampling of a recording to another number of rows, or to another period."""

import numpy as np

from pilotfish.demonstrations.derivatives import add_derivatives
from pilotfish.demonstrations.frames import interpolate
from pilotfish.demonstrations.layouts import Layout
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.signs import unwrap_orientations
from pilotfish.demonstrations.switches import switching_columns
from pilotfish.demonstrations.timestamps import even_times, rows_between
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_period, require_type

MAX_ROWS = 2**24  # of a demonstration


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


def resample_to_period(demo: Demonstration, period: float) -> Demonstration:
    """Resample a demonstration to a period, such as that of a controller.

    Numbers are interpolated linearly, and orientations by slerp. Columns that switch between two values take
    that of the nearest row. Rows of the source that are at the new times are exact. The last row is at or
    before the end of the source.

    Derivatives are computed again as `add_derivatives` does, if they are those of all parts; others are left
    out.

    Args:
        demo: Demonstration.
        period: Time between two rows of the result [s]; at most the duration of the demonstration.

    Returns:
        The resampled demonstration; the demonstration itself if it has this period.

    Raises:
        InvalidInput: If the period is not positive, exceeds the duration, or gives more than 2^24 rows; or if
            a moving frame is singular between two rows.

    Source:
        Shoemake 1985, Animating rotation with quaternion curves: slerp.
    """
    require_type(demo, "demo", Demonstration, "create one with demonstrations.demonstration")
    seconds = require_period(period)
    if seconds == demo.period:
        return demo
    duration = demo.period * (len(demo.x) - 1)
    if seconds > duration * (1 + 1e-9):
        raise InvalidInput(
            f"period is {period} s, expected at most the duration of the demonstration, {duration:g} s"
        )
    if duration / seconds > MAX_ROWS:
        raise InvalidInput(
            f"period is {period} s: {duration:g} s have more than {MAX_ROWS} rows; lengthen it"
        )
    source = _without_derivatives(demo)
    between = rows_between(demo.period * np.arange(len(demo.x)), even_times(0.0, duration, seconds))
    unwrapped = unwrap_orientations(source.x, source.layout)
    x = between.interpolate(unwrapped)
    for columns in source.layout.unit_quaternions:
        x[:, columns] = between.interpolate_rotations(unwrapped[:, columns])
    for name in switching_columns(source.x, source.layout):
        column = source.layout.names.index(name)
        x[:, column] = source.x[between.nearest, column]
    frames = [given.resample(between.before + between.fraction, source.layout) for given in source.frames]
    resampled = demonstration(x, seconds, source.layout, frames, demo.name)
    has_all = source is not demo and source.layout.differentiate() == demo.layout
    return add_derivatives(resampled) if has_all else resampled


def _without_derivatives(demo: Demonstration) -> Demonstration:
    """Return a demonstration with its coordinates only."""
    columns = list(demo.layout.coordinates)
    if len(columns) == demo.layout.width:
        return demo
    layout = Layout(tuple(part for part in demo.layout.parts if not part.derivative))
    frames = [
        type(given)(given.name, given.A[..., columns, :][..., columns], given.b[..., columns])
        for given in demo.frames
    ]
    return demonstration(demo.x[:, columns], demo.period, layout, frames, demo.name)


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
