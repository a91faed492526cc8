"""Points that a motion is asked to pass, as a command line writes them: position=.4,.1,.3@4s+-.001."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, radians

import click
import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.planning import ViaPoint, observations, via_point
from pilotfish.station.following import turns
from pilotfish.validation import require_printable, short_repr

PATTERN = re.compile(r"(?P<what>.+)=(?P<value>[^=@]+)@(?P<time>[^@]+?)s?\+-(?P<deviation>.+?)(?P<deg>deg)?")
LONGEST = 200  # characters of a text
SHOWN = "such as position=.4,.1,.3@4s+-.001 or orientation=1,0,0,0@4s+-2deg"


@dataclass(frozen=True, slots=True)
class Wish:
    """A via-point as it was typed. degrees tells that the deviation is an angle, in degrees."""

    text: str
    what: str
    value: tuple[float, ...]
    time: float
    deviation: float
    degrees: bool


class WishType(click.ParamType[Wish]):
    """Text of a command line that says what is to be where and when: WHAT=NUMBERS@SECONDS+-DEVIATION."""

    name = "point"

    def convert(self, value: str | Wish, param: click.Parameter | None, ctx: click.Context | None) -> Wish:
        if isinstance(value, Wish):
            return value
        try:
            require_printable(value, "the text", LONGEST)
        except InvalidInput as error:
            self.fail(str(error), param, ctx)
        found = PATTERN.fullmatch(value.strip())
        if not found:
            self.fail(
                f"{short_repr(value)} is no point, expected WHAT=NUMBERS@SECONDS+-DEVIATION, {SHOWN}",
                param,
                ctx,
            )
        try:
            numbers = tuple(_number(text) for text in found["value"].split(","))
            time, deviation = _number(found["time"]), _number(found["deviation"])
        except ValueError as error:
            self.fail(f"{short_repr(value)} has {error}, expected a finite number, {SHOWN}", param, ctx)
        return Wish(value, found["what"].strip(), numbers, time, deviation, bool(found["deg"]))


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise ValueError(short_repr(text.strip())) from None
    if not isfinite(number):
        raise ValueError(short_repr(text.strip()))
    return number


def points_of(wishes: Sequence[Wish], layout: Layout) -> tuple[ViaPoint, ...]:
    """Via-points in the columns of a skill.

    Raises: InvalidInput, when the deviation of a whole orientation is not in degrees or another one is, or
    when a number cannot be.
    """
    return tuple(_point(wish, layout) for wish in wishes)


def _point(wish: Wish, layout: Layout) -> ViaPoint:
    whole = any(
        wish.what == part.name and not part.derivative and turns(layout, here)
        for part, here in zip(layout.parts, layout.slices, strict=True)
    )
    if whole and not wish.degrees:
        raise InvalidInput(
            f"--via {short_repr(wish.text)}: the deviation of a whole orientation is an angle in degrees; "
            f"say +-{wish.deviation:g}deg, if degrees were meant"
        )
    if wish.degrees and not whole:
        raise InvalidInput(
            f"--via {short_repr(wish.text)}: {short_repr(wish.what)} is no whole orientation; "
            "give the deviation in the unit of its columns, without deg"
        )
    deviation = radians(wish.deviation) if whole else wish.deviation
    try:
        return via_point(wish.what, wish.value, time=wish.time, deviation=deviation)
    except InvalidInput as error:
        raise InvalidInput(f"--via {short_repr(wish.text)}: {error}") from error


@dataclass(frozen=True, slots=True)
class Miss:
    """How far a motion passes from a point at its step: in the columns' unit, or degrees."""

    via: str
    step: int
    miss: float
    unit: str

    @property
    def label(self) -> str:
        what, _, rest = self.via.rpartition("=")
        return f"via {what} at {rest.partition('@')[2].partition('+-')[0].rstrip('s')} s"


def misses(points: Sequence[ViaPoint], wishes: Sequence[Wish], layout: Layout, motion: Motion) -> list[Miss]:
    """What came of each wish."""
    told = []
    for seen, wish in zip(observations(points, layout, motion.x, motion.period), wishes, strict=True):
        x = motion.x[seen.step, seen.columns]
        miss = np.degrees(angle(x, seen.values)) if wish.degrees else np.linalg.norm(x - seen.values)
        unit = "deg" if wish.degrees else layout.units[int(seen.columns[0])]
        told.append(Miss(wish.text, seen.step, float(miss), unit))
    return told


def notes_on_misses(missed: Sequence[Miss], wishes: Sequence[Wish]) -> list[str]:
    """A remark for each point that is missed by more than the deviation it was given."""
    return [
        f"{wish.text} is missed by {miss.miss:.3g} {miss.unit}, more than its deviation: the skill pulls "
        "elsewhere there; a smaller deviation pulls harder"
        for miss, wish in zip(missed, wishes, strict=True)
        if miss.miss > wish.deviation
    ]
