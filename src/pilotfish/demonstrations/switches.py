"""Columns that switch: scalars that take two values only, such as the command of a gripper."""

from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.views import require_compatible
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, short_list

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


def common_switches(
    demonstrations: Sequence[Demonstration], names: Sequence[str]
) -> tuple[tuple[int, ...], ...]:
    """Return the steps at which columns switch, if they do so in the same order in all demonstrations.

    These are events that the demonstrations share, such as the closing of a gripper. Two columns that switch
    at the same step are one event.

    Args:
        demonstrations: At least one; all have the same layout.
        names: Columns that switch, from `switching_columns`.

    Returns:
        For each demonstration, the first step after each switch. Empty if the order differs, or if no column
        switches.

    Raises:
        InvalidInput: If the list is empty, layouts differ, or a column is unknown.
    """
    require_compatible(demonstrations)
    layout = demonstrations[0].layout
    require_type(names, "names", Sequence, "pass names of columns")
    if unknown := [name for name in names if name not in layout.names]:
        raise InvalidInput(f"no column is named {unknown[0]!r}, expected some of {short_list(layout.names)}")
    columns = [layout.names.index(name) for name in names]
    stacked = np.concatenate([demo.x[:, columns] for demo in demonstrations])
    middle = 0.5 * (stacked.min(axis=0) + stacked.max(axis=0)) if columns else np.empty(0)
    sequences, steps = [], []
    for demo in demonstrations:
        levels = demo.x[:, columns] > middle
        rows = np.flatnonzero((levels[1:] != levels[:-1]).any(axis=1)) + 1
        sequences.append(levels[[0, *rows]].tolist())
        steps.append(tuple(rows.tolist()))
    is_common = all(sequence == sequences[0] for sequence in sequences)
    return tuple(steps) if is_common and steps[0] else ()
