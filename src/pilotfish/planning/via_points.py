"""Where a person wants a motion to pass, and when."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pilotfish.demonstrations import Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.planning.tangent_chart import TangentChart
from pilotfish.types import Array, Float, Int
from pilotfish.validation import finite_array, numeric_array, require_number, require_printable, require_type

Numbers = float | Sequence[float] | Array
MAX_VALUE = 1e50
MIN_DEVIATION, MAX_DEVIATION = 1e-50, 1e50  # their squares and what these are divided by are finite
MIN_PERIOD = 1e-100  # s
UNIT_TOLERANCE = 1e-3  # what typing a quaternion may cost in its norm


@dataclass(frozen=True, slots=True, eq=False)
class ViaPoint:
    """At a time [s] after the start, what is to be value, give or take deviation.

    what is a part of the layout, or one column of it: "position", "position z", "position'" for its speed.
    deviation is one standard deviation of each column, in its unit: the wish counts like a measurement of
    that precision. That of a whole orientation, a unit quaternion w x y z, is the angle of a rotation [rad].
    """

    what: str
    value: Float[Array, " C"]
    time: float
    deviation: Float[Array, " C"]


def via_point(what: str, value: Numbers, *, time: float, deviation: Numbers) -> ViaPoint:
    """The door for a person's wishes; see ViaPoint. One deviation may stand for all columns.

    Raises: InvalidInput, when a number is not finite, time is negative or a deviation is not above zero.
    """
    require_type(what, "what", str, 'give the name of a part or column, say "position"')
    require_printable(what, "the name of what is wished")
    target = np.atleast_1d(finite_array(value, f"the value of {what!r}", maximum=MAX_VALUE))
    spread = numeric_array(deviation, f"the deviation of {what!r}")
    if target.ndim != 1 or spread.shape not in ((), target.shape):
        raise InvalidInput(
            f"{what!r} is wished to be of shape {target.shape} within {spread.shape}, expected a number for "
            "each column, and one deviation for each or one for all"
        )
    if not ((spread >= MIN_DEVIATION) & (spread <= MAX_DEVIATION)).all():
        raise InvalidInput(
            f"the deviation of {what!r} is {spread.tolist()}, expected positive numbers from "
            f"{MIN_DEVIATION:g} to {MAX_DEVIATION:g} in the unit of its columns; a small one, say "
            "1e-4, makes it exact"
        )
    try:
        seconds = require_number(time, "time", 0.0)
    except InvalidInput as error:
        raise InvalidInput(f"the time of {what!r}: {error}: seconds after the start") from error
    return ViaPoint(what, target, seconds, np.broadcast_to(spread, target.shape).copy())


def via_point_to_tangent(point: ViaPoint, chart: TangentChart) -> ViaPoint:
    """The same wish on the flat map of a skill with orientations on S^3, for its plans: see chart.skill.

    A unit quaternion becomes the map's rotation vector [rad] of it or of its negative, whichever lies nearer
    to a state. Its deviation stays; off the base the map stretches turns about other axes than its own, by
    less than two within half a turn.
    Raises: InvalidInput, when an orientation is not four numbers of norm one with one deviation for all, or
    is to turn at a speed: only on the map itself, "orientation'" of chart.skill.layout, is that a column.
    """
    require_type(point, "the via-point", ViaPoint, 'pf.via_point("position", ...) makes one')
    require_type(chart, "chart", TangentChart, "planning.tangent_chart(adapted) makes one")
    layout = chart.manifold_skill.layout
    columns, _ = _columns(point.what, layout)
    part = next(
        p
        for p, part_columns in zip(layout.parts, layout.slices, strict=True)
        if columns[0] < part_columns.stop
    )
    turning = part.name in {p.name for p in layout.parts if p.quantity is Quantity.ORIENTATION}
    if turning and part.derivative and point.value.any():
        raise InvalidInput(
            f"{point.what!r} is wished to be {point.value.tolist()} rad/s, expected 0: on a flat map the "
            "rate depends on the orientation; take chart.to_tangent of a whole pose with its speeds"
        )
    if not turning or part.derivative:
        return point
    if len(point.value) != len(columns) or len(set(point.deviation)) > 1 or len(columns) == 1:
        raise InvalidInput(
            f"{point.what!r} is wished to be {point.value.tolist()} within {point.deviation.tolist()}, "
            f"expected a whole unit quaternion of {part.name!r}, and one angle [rad]"
        )
    pose = chart.manifold_skill.means[0].copy()
    pose[columns] = _unit_quaternion(point)
    vector = chart.to_tangent(pose)[chart.skill.layout.columns(part.name)]
    return ViaPoint(point.what, vector, point.time, point.deviation[:1].repeat(len(vector)))


@dataclass(frozen=True, slots=True, eq=False)
class ViaPointObservation:
    """A via-point at its step: x[step, columns] = values, with independent deviations."""

    step: int
    columns: Int[Array, " C"]
    values: Float[Array, " C"]
    deviations: Float[Array, " C"]


def observe_via_points(
    points: Sequence[ViaPoint], layout: Layout, states: Float[Array, "T n"], period: float | None
) -> list[ViaPointObservation]:
    """The via-points at the steps of a plan or motion, each at the nearest: at most half a period [s] away.

    A quaternion takes the sign that agrees with the state there.
    Raises: InvalidInput, when a point is outside its time, names no part or column, has another number
    of columns, or is an orientation but no unit quaternion; when period is None; and when two
    points want one column at one step further apart than both deviations together.
    """
    require_type(points, "points", Sequence, "give a list: [pf.via_point(...)]")
    for point in points:
        require_type(point, "a via-point", ViaPoint, 'pf.via_point("position", ...) makes one')
    found = [_observe(point, layout, states, period) for point in points]
    for (one, a), (other, b) in combinations(zip(points, found, strict=True), 2):
        if a.step == b.step:
            _require_consistent(one, other, a, b)
    return found


def _observe(
    point: ViaPoint, layout: Layout, states: Float[Array, "T n"], period: float | None
) -> ViaPointObservation:
    columns, turn = _columns(point.what, layout)
    if len(columns) != len(point.value):
        raise InvalidInput(
            f"{point.what!r} is wished to be {len(point.value)} numbers, expected {len(columns)}: "
            f"{', '.join(layout.names[c] for c in columns)}; planning.on_chart puts a quaternion on a map"
        )
    step = _step(point, len(states) - 1, period)
    if not turn:
        return ViaPointObservation(step, columns, point.value, point.deviation)
    q = _unit_quaternion(point)
    sign = -1.0 if q @ states[step, columns] < 0.0 else 1.0
    # Turning by an angle moves a unit quaternion by half of it.
    return ViaPointObservation(step, columns, sign * q, 0.5 * point.deviation)


def _unit_quaternion(point: ViaPoint) -> Float[Array, " 4"]:
    norm = float(np.linalg.norm(point.value))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise InvalidInput(
            f"{point.what!r} is wished to be {point.value.tolist()} of norm {norm:.4g}, expected a unit "
            "quaternion w x y z"
        )
    return np.asarray(point.value / norm)


def _columns(what: str, layout: Layout) -> tuple[Int[Array, " C"], bool]:
    """The columns of a part or of one column, and whether they are a whole orientation."""
    if what in layout.names:
        return np.array([layout.names.index(what)]), False
    name = what.rstrip("'")
    columns = np.arange(layout.width)[layout.columns(name, len(what) - len(name))]
    orientations = (*(quaternion.start for quaternion in layout.quaternions), *layout.orientation_starts)
    return columns, bool(columns[0] in orientations)


def _step(point: ViaPoint, last: int, period: float | None) -> int:
    if period is None:
        raise InvalidInput(
            "the plan knows no period, so no step has a time; give it one: Reference(..., period)"
        )
    steps = point.time / require_number(period, "the plan's period", MIN_PERIOD)
    if not 1 <= (step := round(min(steps, last + 1.0))) <= last:
        raise InvalidInput(
            f"{point.what!r} is wished at {point.time:g} s, expected {period:g} to {last * period:g} s: the "
            "motion begins at its start and ends with the plan's horizon"
        )
    return step


def _require_consistent(
    one: ViaPoint, other: ViaPoint, a: ViaPointObservation, b: ViaPointObservation
) -> None:
    shared, in_a, in_b = np.intersect1d(a.columns, b.columns, return_indices=True)
    distances = np.abs(a.values[in_a] - b.values[in_b])
    if (distances > a.deviations[in_a] + b.deviations[in_b]).any():
        raise InvalidInput(
            f"{one.what!r} and {other.what!r} are wished {distances.max():.3g} apart at step {a.step}, in column "
            f"{shared[distances.argmax()]}: no motion is within the deviation of both; move one in time, or widen"
        )
