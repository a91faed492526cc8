"""Anomalies in the rows of a demonstration: units, times, repeated rows, jumps and turns of angles."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from math import tau

import numpy as np

from pilotfish.demonstrations.layouts import Part, Quantity
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.timestamps import held_run
from pilotfish.demonstrations.units import ANGLE, LENGTH, TIME, Unit, is_unit, parse_unit
from pilotfish.types import Array, Float, Int
from pilotfish.validation import short_list

MIN_JUMP_RATIO = 5.0  # of a step to the steps before and after it
MIN_JUMP_FRACTION = 0.05  # of the diagonal of the part's range
TURN_TOLERANCE = 0.5  # rad, of a jump by a whole turn
LARGE_WORKSPACE, SMALL_WORKSPACE = 10.0, 0.002  # m, diagonal
LARGE_SPEED = 10.0  # m/s, of a hand
LARGE_ANGLE = 4.0 * tau  # rad
TIME_NAMES = {"time", "times", "t", "timestamp", "timestamps", "stamp", "secs", "seconds"}
TIME_TOLERANCE = 0.02  # of the period


@dataclass(frozen=True, slots=True)
class Anomaly:
    """What was found in one demonstration.

    Attributes:
        severity: As in `Diagnostic`.
        kind: Name of the anomaly.
        subject: Part, column or frame that it concerns.
        message: What was found.
    """

    severity: str
    kind: str
    subject: str
    message: str


def row_anomalies(demo: Demonstration, switches: Collection[str]) -> Iterator[Anomaly]:
    """Yield the anomalies in the rows of a demonstration.

    Args:
        demo: Demonstration whose quaternions have continuous signs.
        switches: Columns that switch.
    """
    constant = np.flatnonzero(np.ptp(demo.x, axis=0) == 0)
    if constant.size:
        names = short_list([repr(demo.layout.names[column]) for column in constant])
        message = f"is constant in {names}; its variance is then the regularisation"
        yield Anomaly("note", "constant columns", names, message)
    for part, columns in zip(demo.layout.parts, demo.layout.slices, strict=True):
        if part.derivative:
            continue
        if is_time(part):
            yield from _time_anomalies(demo, part, demo.x[:, columns.start])
            continue
        smooth = [
            c
            for c in range(columns.start, columns.stop)
            if demo.layout.names[c] not in switches and c not in constant
        ]
        if smooth:
            x = demo.x[:, smooth]
            held = list(_held_rows(demo, part, x))
            yield from held
            yield from _unit_anomalies(demo, part, x)
            if not held and part.quantity is not Quantity.VECTOR:  # forces jump at contacts
                yield from _jumps(part, x)


def is_time(part: Part) -> bool:
    """Return whether a part is the time of the rows, by its unit or name."""
    has_time_unit = is_unit(part.unit) and parse_unit(part.unit, "unit").si == TIME
    is_named = part.name.lower() in TIME_NAMES and part.unit in ("1", "")
    return part.quantity is Quantity.SCALAR and part.size == 1 and (has_time_unit or is_named)


def _time_anomalies(demo: Demonstration, part: Part, values: Float[Array, " T"]) -> Iterator[Anomaly]:
    steps = np.diff(values)
    unit = parse_unit(part.unit, "unit")
    factor = unit.factor if unit.si == TIME else 1.0
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        message = f"column {part.name!r} does not ascend at row {row} (first is 0)"
        yield Anomaly("warning", "times", part.name, message)
        return
    low, middle, high = (float(v) * factor for v in (steps.min(), np.median(steps), steps.max()))
    if max(demo.period - low, high - demo.period) > TIME_TOLERANCE * demo.period:
        message = (
            f"column {part.name!r} ascends by {low:.4g} to {high:.4g} s per row (median {middle:.4g}), but "
            f"the period is {demo.period:.4g} s"
        )
        yield Anomaly("warning", "times", part.name, message)
    else:
        message = (
            f"column {part.name!r} is the time; it is learned as a coordinate, remove it if it is not one"
        )
        yield Anomaly("note", "time column", part.name, message)


def _held_rows(demo: Demonstration, part: Part, x: Float[Array, "T d"]) -> Iterator[Anomaly]:
    if (run := held_run(x)) > 1:
        message = (
            f"{part.name} holds each value for {run} rows: its true period is {run * demo.period:.6g} s, not "
            f"{demo.period:.6g} s, and speeds from these rows are wrong"
        )
        yield Anomaly("warning", "held rows", part.name, message)


def _unit_anomalies(demo: Demonstration, part: Part, x: Float[Array, "T d"]) -> Iterator[Anomaly]:
    unit = parse_unit(part.unit, "unit") if is_unit(part.unit) else Unit(1.0, "")
    if unit.si in (LENGTH, ANGLE) and unit.factor != 1.0:
        message = f"{part.name} is in {part.unit}, expected {unit.si}, in which frames, tasks and robots are"
        yield Anomaly("warning", "units", part.name, message)
    if unit.si == LENGTH and part.quantity is Quantity.POSITION:
        yield from _length_anomalies(demo, part, unit.factor * x)
    largest = float(np.abs(x).max())
    if unit.si == ANGLE and part.quantity is Quantity.SCALAR and unit.factor * largest > LARGE_ANGLE:
        message = f"{part.name} reaches {largest:.4g} {part.unit}, {unit.factor * largest / tau:.3g} turns"
        hint = "; are the values in degrees?" if unit.factor == 1.0 else "; are the values in rad?"
        yield Anomaly("warning", "size", part.name, message + hint)


def _length_anomalies(demo: Demonstration, part: Part, x: Float[Array, "T d"]) -> Iterator[Anomaly]:
    """Yield implausible extents and speeds of positions in metres."""
    diagonal = float(np.linalg.norm(np.ptp(x, axis=0)))
    stated = f"in {part.unit}, as the layout states"
    if diagonal > LARGE_WORKSPACE:
        message = f"{part.name} covers {diagonal:.3g} m; are the values really {stated}, and not in mm or cm?"
        yield Anomaly("warning", "size", part.name, message)
    elif 0.0 < diagonal < SMALL_WORKSPACE:
        message = f"{part.name} covers only {1e3 * diagonal:.3g} mm; are the values really {stated}?"
        yield Anomaly("warning", "size", part.name, message)
    speed = float(np.linalg.norm(np.diff(x, axis=0), axis=1).max(initial=0.0)) / demo.period
    if speed > LARGE_SPEED and diagonal <= LARGE_WORKSPACE:
        message = (
            f"{part.name} moves at up to {speed:.3g} m/s; check the period, {demo.period:.4g} s, and that no "
            "rows are missing"
        )
        yield Anomaly("warning", "size", part.name, message)


def _jumps(part: Part, x: Float[Array, "T d"]) -> Iterator[Anomaly]:
    """Yield jumps of coordinates; those of an angle by a whole turn are named so."""
    rows = jump_rows(x)
    turn = 360.0 if part.unit == "deg" else tau
    is_scalar = part.quantity is Quantity.SCALAR and part.unit in ("rad", "deg", "1")
    steps = np.diff(x, axis=0)
    turned = np.abs(np.abs(steps) - turn) < TURN_TOLERANCE * turn / tau
    if is_scalar and turned.any():
        wrapped = np.flatnonzero(turned.any(axis=1)) + 1
        message = (
            f"{part.name} jumps by a whole turn at row {wrapped[0]} (first is 0), {wrapped.size} times in "
            "all: the angle wraps around"
        )
        yield Anomaly("warning", "wrap-around", part.name, message)
        rows = np.setdiff1d(rows, wrapped)
    if rows.size:
        message = (
            f"{part.name} jumps at row {rows[0]} (first is 0), {rows.size} times in all; "
            "rows may be missing or repeated"
        )
        yield Anomaly("warning", "jumps", part.name, message)


def jump_rows(x: Float[Array, "T d"]) -> Int[Array, " J"]:
    """Return the rows reached by a step that is far longer than the steps before and after it.

    Args:
        x: Rows.
    """
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    before = np.concatenate([[0.0], steps[:-1]])
    after = np.concatenate([steps[1:], [0.0]])
    diagonal = float(np.linalg.norm(np.ptp(x, axis=0)))
    jumps = (steps > MIN_JUMP_RATIO * np.maximum(before, after)) & (steps > MIN_JUMP_FRACTION * diagonal)
    return np.flatnonzero(jumps).astype(np.int64) + 1
