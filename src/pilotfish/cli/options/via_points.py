"""Points that a motion is asked to pass, as a command line writes them: position=.4,.1,.3@4s+-.001."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, radians

import click
import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import (
    Layout,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.planning import ViaPoint, observe_via_points, via_point
from pilotfish.validation import require_printable, short_repr

PATTERN = re.compile(r"(?P<what>.+)=(?P<value>[^=@]+)@(?P<time>[^@]+?)s?\+-(?P<deviation>.+?)(?P<deg>deg)?")
MAX_LENGTH = 200  # characters of a text
EXAMPLES = "such as position=.4,.1,.3@4s+-.001 or orientation=1,0,0,0@4s+-2deg"


@dataclass(frozen=True, slots=True)
class ViaPointOption:
    """A via-point as it was typed. degrees tells that the deviation is an angle, in degrees."""

    text: str
    columns: str
    value: tuple[float, ...]
    time: float
    deviation: float
    degrees: bool


class ViaPointType(click.ParamType[ViaPointOption]):
    """Text of a command line that says what is to be where and when: WHAT=NUMBERS@SECONDS+-DEVIATION."""

    name = "point"

    def convert(
        self, value: str | ViaPointOption, param: click.Parameter | None, ctx: click.Context | None
    ) -> ViaPointOption:
        if isinstance(value, ViaPointOption):
            return value
        try:
            require_printable(value, "the text", MAX_LENGTH)
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
        found = PATTERN.fullmatch(value.strip())
        if not found:
            self.fail(
                f"{short_repr(value)} is no point, expected WHAT=NUMBERS@SECONDS+-DEVIATION, {EXAMPLES}",
                param,
                ctx,
            )
        try:
            numbers = tuple(_number(text) for text in found["value"].split(","))
            time, deviation = _number(found["time"]), _number(found["deviation"])
        except ValueError as error:
            self.fail(f"{short_repr(value)} has {error}, expected a finite number, {EXAMPLES}", param, ctx)
        return ViaPointOption(value, found["what"].strip(), numbers, time, deviation, bool(found["deg"]))


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise ValueError(short_repr(text.strip())) from None
    if not isfinite(number):
        raise ValueError(short_repr(text.strip()))
    return number


def to_via_points(options: Sequence[ViaPointOption], layout: Layout) -> tuple[ViaPoint, ...]:
    """Via-points in the columns of a skill.

    Raises: InvalidInput, when the deviation of a whole orientation is not in degrees or another one is, or
    when a number cannot be.
    """
    return tuple(_to_via_point(option, layout) for option in options)


def _to_via_point(option: ViaPointOption, layout: Layout) -> ViaPoint:
    is_orientation = option.columns in [layout.names[c.start][:-2] for c in layout.unit_quaternions]
    if is_orientation and not option.degrees:
        raise InvalidInput(
            f"--via-point {short_repr(option.text)}: the deviation of a whole orientation is an angle in degrees; "
            f"say +-{option.deviation:g}deg, if degrees were meant"
        )
    if option.degrees and not is_orientation:
        raise InvalidInput(
            f"--via-point {short_repr(option.text)}: {short_repr(option.columns)} is no whole orientation; "
            "give the deviation in the unit of its columns, without deg"
        )
    deviation = radians(option.deviation) if is_orientation else option.deviation
    try:
        return via_point(option.columns, option.value, time=option.time, deviation=deviation)
    except InvalidInput as error:
        raise InvalidInput(f"--via-point {short_repr(option.text)}: {error}") from error


@dataclass(frozen=True, slots=True)
class ViaPointError:
    """How far a motion passes from a point at its step: in the columns' unit, or degrees."""

    via: str
    step: int
    error: float
    unit: str

    @property
    def label(self) -> str:
        columns, _, rest = self.via.rpartition("=")
        return f"via {columns} at {rest.partition('@')[2].partition('+-')[0].rstrip('s')} s"


def via_point_errors(
    points: Sequence[ViaPoint], options: Sequence[ViaPointOption], layout: Layout, motion: Motion
) -> list[ViaPointError]:
    """What came of each wish."""
    errors = []
    for observation, option in zip(
        observe_via_points(points, layout, motion.x, motion.period), options, strict=True
    ):
        x = motion.x[observation.step, observation.columns]
        error = (
            np.degrees(angle(x, observation.values))
            if option.degrees
            else np.linalg.norm(x - observation.values)
        )
        unit = "deg" if option.degrees else layout.units[int(observation.columns[0])]
        errors.append(ViaPointError(option.text, observation.step, float(error), unit))
    return errors


def via_point_notes(errors: Sequence[ViaPointError], options: Sequence[ViaPointOption]) -> list[str]:
    """A remark for each point that is missed by more than the deviation it was given."""
    return [
        f"{option.text} is missed by {error.error:.3g} {error.unit}, more than its deviation: the skill pulls "
        "elsewhere there; a smaller deviation pulls harder"
        for error, option in zip(errors, options, strict=True)
        if error.error > option.deviation
    ]
