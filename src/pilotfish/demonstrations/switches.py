"""Columns that switch: scalars that take two values only, such as the command of a gripper."""

from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.views import require_compatible
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
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
    lowest, highest = x.min(axis=0), x.max(axis=0)
    return select_switches(count_at_limits(x, lowest, highest), len(x), (lowest, highest), layout)


def count_at_limits(
    x: Float[Array, "N D"], lowest: Float[Array, " D"], highest: Float[Array, " D"]
) -> Int[Array, " D"]:
    """Count the rows at which each column is close to its smallest or largest value of all rows.

    Args:
        x: Some of the rows.
        lowest: Smallest value of each column, of all rows.
        highest: Largest value of each column, of all rows.

    Returns:
        The number of rows for each column.
    """
    margin = LEVEL_TOLERANCE * (highest - lowest)
    return np.asarray(((x <= lowest + margin) | (x >= highest - margin)).sum(axis=0))


def select_switches(
    counts: Int[Array, " D"],
    rows: int,
    limits: tuple[Float[Array, " D"], Float[Array, " D"]],
    layout: Layout,
) -> tuple[str, ...]:
    """Return the names of the columns that switch.

    Args:
        counts: Rows at which each column is close to a limit, as `count_at_limits` returns.
        rows: Number of rows.
        limits: Smallest and largest value of each column.
        layout: Columns of the rows.
    """
    low, high = limits
    varies = high - low > CONSTANT * np.maximum(np.abs(low), np.abs(high))
    switches = varies & (counts / rows >= MIN_SHARE)
    return tuple(
        layout.names[column]
        for part, columns in zip(layout.parts, layout.slices, strict=True)
        if part.quantity is Quantity.SCALAR and not part.derivative
        for column in range(columns.start, columns.stop)
        if switches[column]
    )


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
