"""Via-points of the command line, such as position=.4,.1,.3@4s+-.001.

The text is parsed before the skill is known, so that wrong syntax is a usage error. Only the skill determines
whether a name is an orientation, whose deviation is an angle [deg]; `to_via_points` checks that later.
"""

import re
from collections.abc import Sequence
from math import isfinite, radians
from typing import Any

import click
import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.planning import ViaPoint, observe_via_points, via_point
from pilotfish.validation import require_printable, short_repr

PATTERN = re.compile(r"(?P<name>.+)=(?P<value>[^=@]+)@(?P<time>[^@]+?)s?\+-(?P<deviation>.+?)(?P<deg>deg)?")
SYNTAX = "NAME=VALUES@SECONDS+-DEVIATION"
EXAMPLES = "such as position=.4,.1,.3@4s+-.001 or orientation=1,0,0,0@4s+-2deg"
MAX_LENGTH = 200  # characters


class ViaPointType(click.ParamType[re.Match[str]]):
    """Type of the option --via-point; a value is a match of PATTERN with finite numbers."""

    name = "point"

    def convert(
        self, value: str | re.Match[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> re.Match[str]:
        """Parse the text of the option."""
        if isinstance(value, re.Match):
            return value
        try:
            require_printable(value, "the text", MAX_LENGTH)
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
        match = PATTERN.fullmatch(value.strip())
        if not match:
            self.fail(f"{short_repr(value)} is not a via-point, expected {SYNTAX}, {EXAMPLES}", param, ctx)
        for number in (*match["value"].split(","), match["time"], match["deviation"]):
            if not _is_finite_number(number):
                text = short_repr(number.strip())
                self.fail(
                    f"{short_repr(value)} contains {text}, expected a finite number, {EXAMPLES}", param, ctx
                )
        return match


def _is_finite_number(text: str) -> bool:
    try:
        return isfinite(float(text))
    except ValueError:
        return False


def to_via_points(options: Sequence[re.Match[str]], layout: Layout) -> tuple[ViaPoint, ...]:
    """Convert the values of --via-point to via-points in the columns of a skill.

    Args:
        options: Values of the option.
        layout: Columns of the skill.

    Returns:
        Via-points; the deviation of an orientation is in radians.

    Raises:
        InvalidInput: If the unit deg is missing for an orientation or given for another part, or a number
            is out of range.
    """
    return tuple(_to_via_point(option, layout) for option in options)


def _to_via_point(option: re.Match[str], layout: Layout) -> ViaPoint:
    name, deviation = option["name"].strip(), float(option["deviation"])
    is_turn = name in [layout.names[columns.start][:-2] for columns in layout.unit_quaternions]  # less " w"
    prefix = f"--via-point {short_repr(option.string)}"
    if is_turn and not option["deg"]:
        raise InvalidInput(
            f"{prefix}: the deviation of an orientation is an angle in degrees; write +-{deviation:g}deg if "
            "it is in degrees"
        )
    if option["deg"] and not is_turn:
        raise InvalidInput(
            f"{prefix}: {short_repr(name)} is not an orientation; give the deviation in the unit of the "
            "columns, without deg"
        )
    values = [float(text) for text in option["value"].split(",")]
    try:
        return via_point(
            name,
            values,
            time=float(option["time"]),
            deviation=radians(deviation) if is_turn else deviation,
        )
    except InvalidInput as error:
        raise InvalidInput(f"{prefix}: {error}") from error


def via_point_errors(
    points: Sequence[ViaPoint], options: Sequence[re.Match[str]], layout: Layout, motion: Motion
) -> list[dict[str, Any]]:
    """Return the distance between a motion and each via-point, for programs.

    Args:
        points: Via-points from `to_via_points`.
        options: The options that they were converted from.
        layout: Columns of the motion.
        motion: Motion to compare.

    Returns:
        For each via-point its text, its step, the error, and the unit of the error.
    """
    observations = observe_via_points(points, layout, motion.x, motion.period)
    errors: list[dict[str, Any]] = []
    for observation, option in zip(observations, options, strict=True):
        x = motion.x[observation.step, observation.columns]
        if option["deg"]:
            error, unit = np.degrees(angle(x, observation.values)), "deg"
        else:
            error = np.linalg.norm(x - observation.values)
            unit = layout.units[int(observation.columns[0])]
        errors.append(
            {"via_point": option.string, "step": observation.step, "error": float(error), "unit": unit}
        )
    return errors


def via_point_rows(
    errors: Sequence[dict[str, Any]], options: Sequence[re.Match[str]]
) -> list[tuple[str, str]]:
    """Return a row for people for each via-point: name, time and error."""
    return [
        (f"via {option['name'].strip()} at {option['time']} s", f"error {error['error']:.3g} {error['unit']}")
        for error, option in zip(errors, options, strict=True)
    ]


def via_point_notes(errors: Sequence[dict[str, Any]], options: Sequence[re.Match[str]]) -> list[str]:
    """Return a note for each via-point whose error is larger than its deviation."""
    return [
        f"the motion misses {option.string} by {error['error']:.3g} {error['unit']}, more than the "
        "deviation; a smaller deviation brings it closer"
        for error, option in zip(errors, options, strict=True)
        if error["error"] > float(option["deviation"])
    ]
