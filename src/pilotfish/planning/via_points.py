"""Via-points: desired values of columns at given times, and their observations at steps of a plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import (
    finite_array,
    numeric_array,
    require_number,
    require_printable,
    require_type,
    shorten_repr,
)

Numbers = float | Sequence[float] | Array
MAX_VALUE = 1e50
MIN_DEVIATION, MAX_DEVIATION = 1e-50, 1e50  # their squares and reciprocals are finite
MIN_PERIOD = 1e-100  # s
UNIT_TOLERANCE = 1e-3  # of the norm of a quaternion that was typed


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ViaPoint:
    """Desired value of some columns at a time, with its standard deviation; `via_point` creates it.

    Attributes:
        name: Name of a part or of one column: "position", "position z", "position'" for its velocity.
        value: Desired value of each column; a unit quaternion w x y z for an orientation.
        time: Time after the start [s].
        deviation: Standard deviation of each column, in its unit: the via-point has the weight of a
            measurement of this precision. For a whole orientation it is the angle of a rotation [rad].
    """

    name: str
    value: Float[Array, " C"]
    time: float
    deviation: Float[Array, " C"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ViaPointObservation:
    """Via-point as a measurement at a step: x[step, columns] = values, with independent noise.

    Attributes:
        step: Step of the plan or motion.
        columns: Measured columns.
        values: Measured values; a quaternion has the sign of the plan.
        deviations: Standard deviations.
    """

    step: int
    columns: Int[Array, " C"]
    values: Float[Array, " C"]
    deviations: Float[Array, " C"]


def via_point(name: str, value: Numbers, *, time: float, deviation: Numbers) -> ViaPoint:
    """Create a via-point.

    Args:
        name: Name of a part or of one column of the layout, such as "position" or "position z".
        value: One number per column.
        time: Time after the start [s], not negative.
        deviation: Standard deviation of each column, or one for all, positive; a small one makes it exact.

    Raises:
        InvalidInput: If a number is not finite or out of range.

    Example:
        >>> from pilotfish.planning import via_point
        >>> via_point("position", [0.4, 0.1, 0.3], time=2.0, deviation=0.001).deviation
        array([0.001, 0.001, 0.001])
    """
    require_type(name, "name", str, 'pass the name of a part or column, such as "position"')
    require_printable(name, "the name of a via-point")
    target = np.atleast_1d(finite_array(value, f"the value of {name!r}", maximum=MAX_VALUE))
    deviations = numeric_array(deviation, f"the deviation of {name!r}")
    if target.ndim != 1 or deviations.shape not in ((), target.shape):
        raise InvalidInput(
            f"the value of {name!r} has shape {target.shape} and its deviation {deviations.shape}, expected "
            "one number per column, and one deviation per column or one for all"
        )
    if not ((deviations >= MIN_DEVIATION) & (deviations <= MAX_DEVIATION)).all():
        raise InvalidInput(
            f"the deviation of {name!r} is {deviations.tolist()}, expected positive numbers from "
            f"{MIN_DEVIATION:g} to {MAX_DEVIATION:g} in the unit of its columns; a small one such as 1e-4 "
            "makes it exact"
        )
    try:
        seconds = require_number(time, "time", 0.0)
    except InvalidInput as error:
        raise InvalidInput(f"the time of {name!r}: {error}: seconds after the start") from error
    return ViaPoint(name, target, seconds, np.broadcast_to(deviations, target.shape).copy())


def observe_via_points(
    points: Sequence[ViaPoint], layout: Layout, states: Float[Array, "T n"], period: float | None
) -> list[ViaPointObservation]:
    """Return via-points as measurements at the nearest steps, at most half a period away.

    Args:
        points: Via-points.
        layout: Columns of the states.
        states: Targets of a plan or states of a motion; a quaternion takes the sign of the state.
        period: Time between two states [s].

    Raises:
        InvalidInput: If a point is outside the time of the states, names no part or column, has another
            number of columns, or is an orientation but not a unit quaternion. Also if period is None, or two
            points differ in one column at one step by more than the sum of their deviations.
    """
    require_type(points, "points", Sequence, "pass a list: [pf.via_point(...)]")
    for point in points:
        require_type(point, "a via-point", ViaPoint, 'pf.via_point("position", ...) makes one')
    observations = [_observe(point, layout, states, period) for point in points]
    for (p, a), (q, b) in combinations(zip(points, observations, strict=True), 2):
        if a.step == b.step:
            _require_consistent(p, q, a, b)
    return observations


def named_columns(name: str, layout: Layout) -> tuple[Int[Array, " C"], bool]:
    """Return the columns of a part or of one column, and whether they are a whole orientation."""
    if name in layout.names:
        return np.array([layout.names.index(name)]), False
    part = name.rstrip("'")
    columns = layout.columns(part, len(name) - len(part))
    return np.arange(layout.width)[columns], columns in layout.unit_quaternions


def unit_quaternion(point: ViaPoint) -> Float[Array, " 4"]:
    """Return the value of an orientation, normalised."""
    norm = float(np.linalg.norm(point.value))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise InvalidInput(
            f"the value of {point.name!r} is {point.value.tolist()} of norm {norm:.4g}, expected a unit "
            "quaternion w x y z"
        )
    return np.asarray(point.value / norm)


def _observe(
    point: ViaPoint, layout: Layout, states: Float[Array, "T n"], period: float | None
) -> ViaPointObservation:
    columns, is_orientation = named_columns(point.name, layout)
    if len(columns) != len(point.value):
        raise InvalidInput(
            f"the value of {point.name!r} has {len(point.value)} numbers, expected {len(columns)}: "
            f"{', '.join(layout.names[c] for c in columns)}; TangentChart.via_point converts a quaternion"
        )
    step = _step(point, len(states) - 1, period)
    if not is_orientation:
        return ViaPointObservation(step, columns, point.value, point.deviation)
    q = unit_quaternion(point)
    sign = -1.0 if q @ states[step, columns] < 0.0 else 1.0
    # A rotation by an angle moves a unit quaternion by half of it.
    return ViaPointObservation(step, columns, sign * q, 0.5 * point.deviation)


def _step(point: ViaPoint, last: int, period: float | None) -> int:
    if period is None:
        raise InvalidInput(
            "the plan has no period, so its steps have no times; pass one: Reference(..., period)"
        )
    steps = point.time / require_number(period, "the plan's period", MIN_PERIOD)
    if not 1 <= (step := round(min(steps, last + 1.0))) <= last:
        raise InvalidInput(
            f"the time of {point.name!r} is {point.time:g} s, expected {period:g} to {last * period:g} s: "
            "after the start and within the horizon"
        )
    return step


def _require_consistent(p: ViaPoint, q: ViaPoint, a: ViaPointObservation, b: ViaPointObservation) -> None:
    shared, in_a, in_b = np.intersect1d(a.columns, b.columns, return_indices=True)
    distances = np.abs(a.values[in_a] - b.values[in_b])
    if (distances > a.deviations[in_a] + b.deviations[in_b]).any():
        raise InvalidInput(
            f"{p.name!r} and {q.name!r} differ by {distances.max():.3g} at step {a.step}, in column "
            f"{shared[distances.argmax()]}, expected at most the sum of their deviations; move one in time, "
            "or increase a deviation"
        )
