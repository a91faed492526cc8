"""Checks of the arguments of plots, before a figure is created.

A wrong type is refused with the expression that would give the right one, such as `fit.skill` for a fit.
"""

from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np

from pilotfish.control import Feedback, Motion, Reference
from pilotfish.demonstrations import Demonstration, Frame, Layout, MovingFrame, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, Fit, FrameRelevance, Skill
from pilotfish.plots.style import MAX_STATES
from pilotfish.validation import nearest_name, short_list

Plane = tuple[str, str]  # names of the horizontal and the vertical column


def require_states(states: int) -> None:
    """Check that states can be distinguished by colours and dashes."""
    if not 1 <= states <= MAX_STATES:
        raise InvalidInput(
            f"there are {states} states, expected 1 to {MAX_STATES}, the number of colours and dashes"
        )


def require_width(label: str, width: int, layout: Layout) -> None:
    """Check a number of columns."""
    if width != layout.width:
        raise InvalidInput(
            f"{label} has {width} columns, expected the layout's {layout.width}: {', '.join(layout.names)}"
        )


def require_period(label: str, period: float, expected: float) -> None:
    """Check that a motion or demonstration has the period of the skill."""
    if period != expected:
        raise InvalidInput(
            f"{label} has a period of {period} s, expected the skill's {expected} s; resample it"
        )


def require_same_columns(demonstration: Demonstration, layout: Layout) -> None:
    """Check that a demonstration has the columns of a layout."""
    require_type("demonstration", demonstration, Demonstration)
    if demonstration.layout != layout:
        raise InvalidInput(
            f"demonstration {demonstration.name!r} has the columns {', '.join(demonstration.layout.names)}, "
            f"expected {', '.join(layout.names)}"
        )


def require_motion(motion: Motion, layout: Layout) -> None:
    """Check that a motion has the columns of a layout."""
    require_width("the motion", motion.x.shape[1], layout)


def column_index(layout: Layout, name: str) -> int:
    """Return the index of a column; the error message has the nearest name."""
    if name in layout.names:
        return layout.names.index(name)
    nearest = nearest_name(name, layout.names, cutoff=0.0)
    raise InvalidInput(
        f"the layout has no column {name!r}, the nearest is {nearest!r}; it has {short_list(layout.names)}"
    )


def plane_columns(layout: Layout, planes: Sequence[Plane] | None) -> list[tuple[int, int]]:
    """Return the columns of planes; by default the first two planes of the first position."""
    if planes is None:
        space = position_columns(layout)
        if len(space) < 2:
            raise InvalidInput(
                f"the layout has no position of two or more axes, only {', '.join(layout.names)}; name the "
                "planes to draw, such as planes=[(name, name)]"
            )
        return [(space[0], up) for up in space[1:3]]
    require_column_pairs("planes", planes)
    if not planes:
        raise InvalidInput("planes is empty, expected at least one pair of column names")
    return [(column_index(layout, right), column_index(layout, up)) for right, up in planes]


def column_indices(layout: Layout, columns: Sequence[str] | None) -> list[int]:
    """Return the named columns; by default all that are not derivatives."""
    if columns is None:
        return list(layout.coordinates)
    require_sequence("columns", columns, str)
    if not columns:
        raise InvalidInput("columns is empty, expected at least one name")
    return [column_index(layout, name) for name in columns]


def position_columns(layout: Layout) -> list[int]:
    """Return the columns of the first position; empty if there is none."""
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.POSITION and part.derivative == 0:
            return list(range(columns.start, columns.stop))
    return []


# Expression to write if the first type was passed and the second is expected.
CONVERSION_HINTS = {
    (Fit, Skill): "fit.skill is one",
    (Fit, AdaptedSkill): "adapt(fit.skill, frames) makes one",
    (Skill, AdaptedSkill): "adapt(skill, frames) makes one",
    (AdaptedSkill, Skill): "pass the skill before adapt",
    (Skill, Fit): "learn makes one",
    (Skill, FrameRelevance): "relevance(skill, demonstrations) makes one",
    (Reference, Motion): "track(system, reference, control_cost).rollout(start) makes one",
    (Feedback, Motion): "feedback.rollout(start) makes one",
    (Reference, Feedback): "track(system, reference, control_cost) makes one",
    (Motion, Feedback): "pass the feedback that it was rolled out from",
    (MovingFrame, Frame): "frame.at(t) is one",
}


def require_type(label: str, value: object, *types: type) -> None:
    """Check a type; the message proposes how to convert a related type."""
    if isinstance(value, types):
        return
    hints = [
        hint
        for (given, expected_type), hint in CONVERSION_HINTS.items()
        if isinstance(value, given) and expected_type in types
    ]
    expected = " or ".join(_with_article(expected_type.__name__) for expected_type in types)
    raise InvalidInput(
        "; ".join([f"{label} is {_with_article(type(value).__name__)}, expected {expected}", *hints[:1]])
    )


def require_sequence(label: str, values: object, expected_type: type) -> None:
    """Check that values are a sequence of one type; a single value or a string is refused."""
    if isinstance(values, str):
        raise InvalidInput(f"{label} is the text {values!r}, expected a list of names; write [{values!r}]")
    name = expected_type.__name__
    if isinstance(values, expected_type):
        raise InvalidInput(
            f"{label} is {_with_article(name)}, expected a list of them; write [{name.lower()}]"
        )
    if not isinstance(values, Sequence):
        raise InvalidInput(f"{label} is {_with_article(type(values).__name__)}, expected a list of {name}")
    for n, value in enumerate(values):
        require_type(f"{label}[{n}]", value, expected_type)


def require_column_pairs(label: str, values: object) -> None:
    """Check that values are a sequence of pairs of names; a single pair is refused."""
    single = isinstance(values, Sequence) and all(isinstance(value, str) for value in values)
    if single and values and not isinstance(values, str):
        raise InvalidInput(f"{label} is {values!r}, expected a list of pairs of names; write [{values!r}]")
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise InvalidInput(f"{label} is {values!r}, expected a list of pairs of column names: [(name, name)]")
    for n, pair in enumerate(values):
        if not (isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(name, str) for name in pair)):
            raise InvalidInput(f"{label}[{n}] is {pair!r}, expected a pair of column names: (name, name)")


def require_array(label: str, value: object, axes: str, expected_type: type, fix: str) -> None:
    """Check the number of axes and the NumPy type of an array."""
    if not isinstance(value, np.ndarray):
        raise InvalidInput(
            f"{label} is {_with_article(type(value).__name__)}, expected an array {axes}; {fix}"
        )
    if value.ndim != len(axes.split()) or not np.issubdtype(value.dtype, expected_type):
        actual = f"has shape {value.shape} and entries {value.dtype}"
        raise InvalidInput(
            f"{label} {actual}, expected {expected_type.__name__} entries and axes {axes}; {fix}"
        )


def require_integer(label: str, value: object) -> None:
    """Check that a value is a whole number of steps."""
    if isinstance(value, Integral) and not isinstance(value, bool):
        return
    nearest = round(float(value)) if isinstance(value, Real) and np.isfinite(float(value)) else 200
    raise InvalidInput(f"{label} is {value!r}, expected a whole number of steps such as {nearest}")


def require_number(label: str, value: object) -> None:
    """Check that a value is a real number."""
    if not isinstance(value, Real):
        raise InvalidInput(f"{label} is {value!r}, expected a number")


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
