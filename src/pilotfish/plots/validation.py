"""The room's doors: what cannot be drawn is refused here, before a figure is begun."""

from collections.abc import Sequence

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.plots.kinds import require_column_pairs, require_sequence, require_type
from pilotfish.plots.style import MAX_STATES
from pilotfish.validation import nearest_name, short_list

Plane = tuple[str, str]  # names of the columns that lie to the right and upward


def require_states(states: int) -> None:
    if not 1 <= states <= MAX_STATES:
        raise InvalidInput(
            f"there are {states} states, expected 1 to {MAX_STATES}: the colours and dashes there are"
        )


def require_width(what: str, width: int, layout: Layout) -> None:
    if width != layout.width:
        raise InvalidInput(
            f"{what} has {width} columns, expected the layout's {layout.width}: {', '.join(layout.names)}"
        )


def require_period(what: str, period: float, expected: float) -> None:
    if period != expected:
        raise InvalidInput(
            f"{what} has a period of {period} s, expected the skill's {expected} s; resample it"
        )


def require_same_columns(demonstration: Demonstration, layout: Layout) -> None:
    """A demonstration shown beside a motion has the same columns."""
    require_type("demonstration", demonstration, Demonstration)
    if demonstration.layout != layout:
        raise InvalidInput(
            f"demonstration {demonstration.name!r} has the columns {', '.join(demonstration.layout.names)}, expected "
            f"{', '.join(layout.names)}"
        )


def require_motion(motion: Motion, layout: Layout) -> None:
    require_width("the motion", motion.x.shape[1], layout)


def column_index(layout: Layout, name: str) -> int:
    """Where the column of this name stands.

    Raises: InvalidInput, with the nearest name, when there is none.
    """
    if name in layout.names:
        return layout.names.index(name)
    nearest = nearest_name(name, layout.names, cutoff=0.0)
    raise InvalidInput(
        f"there is no column {name!r}, the nearest is {nearest!r}; of {short_list(layout.names)}"
    )


def plane_columns(layout: Layout, planes: Sequence[Plane] | None) -> list[tuple[int, int]]:
    """The columns of the planes asked for; if None are, the first two planes of the first position."""
    if planes is None:
        space = position_columns(layout)
        if len(space) < 2:
            raise InvalidInput(
                f"the layout has no position of two or more axes but {', '.join(layout.names)}; name the "
                "planes to draw, such as planes=[(name, name)]"
            )
        return [(space[0], up) for up in space[1:3]]
    require_column_pairs("planes", planes)
    if not planes:
        raise InvalidInput("no planes were asked for, expected at least one pair of column names")
    return [(column_index(layout, right), column_index(layout, up)) for right, up in planes]


def column_indices(layout: Layout, columns: Sequence[str] | None) -> list[int]:
    """The columns asked for; if None are, all that are no derivatives.

    Raises: InvalidInput, when a name is unknown or there are none.
    """
    if columns is None:
        parts = zip(layout.parts, layout.slices, strict=True)
        return [i for part, here in parts if part.derivative == 0 for i in range(here.start, here.stop)]
    require_sequence("columns", columns, str)
    if not columns:
        raise InvalidInput("no columns were asked for, expected at least one name")
    return [column_index(layout, name) for name in columns]


def position_columns(layout: Layout) -> list[int]:
    """The columns of the first position; none if there is no position."""
    for part, here in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.POSITION and part.derivative == 0:
            return list(range(here.start, here.stop))
    return []
