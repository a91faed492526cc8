"""Columns that switch: scalars that take two values only, such as the command of a gripper."""

from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.types import Array, Float

CONSTANT = 1e-9  # of the magnitude: a smaller range is rounding
MIN_SHARE = 0.98  # of the rows of a column that switches are at one of its two values
LEVEL_TOLERANCE = 0.01  # of the range: values this close to an end of it count as that end


def switching_columns(x: Float[Array, "N D"], layout: Layout) -> tuple[str, ...]:
    """Return the names of scalar columns that take two values, with rare values between them.

    Args:
        x: Rows of all demonstrations.
        layout: Columns of x.
    """
    names = []
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is not Quantity.SCALAR or part.derivative:
            continue
        for column in range(columns.start, columns.stop):
            values = x[:, column]
            low, high = float(values.min()), float(values.max())
            margin = LEVEL_TOLERANCE * (high - low)
            at_level = (values <= low + margin) | (values >= high - margin)
            if high - low > CONSTANT * max(abs(low), abs(high)) and at_level.mean() >= MIN_SHARE:
                names.append(layout.names[column])
    return tuple(names)
