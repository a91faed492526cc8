"""Units of columns: text such as "mm" or "deg/s", converted to SI units."""

import math
import re
from dataclasses import dataclass

from pilotfish.errors import InvalidInput
from pilotfish.validation import require_printable, short_repr

LENGTH, ANGLE, TIME, NUMBER = "m", "rad", "s", "1"
MAX_EXPONENT = 9

# Factor and SI unit of each symbol. A symbol is looked up as it is written, then in lower case.
SYMBOLS = {
    **dict.fromkeys(("", "1", "-"), (1.0, NUMBER)),
    "m": (1.0, LENGTH),
    "mm": (1e-3, LENGTH),
    "cm": (1e-2, LENGTH),
    **dict.fromkeys(("um", "µm", "μm"), (1e-6, LENGTH)),
    **dict.fromkeys(("in", "inch", "inches"), (0.0254, LENGTH)),
    **dict.fromkeys(("ft", "foot", "feet"), (0.3048, LENGTH)),
    "dm": (0.1, LENGTH),
    "km": (1e3, LENGTH),
    **dict.fromkeys(("rad", "radian", "radians"), (1.0, ANGLE)),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), (math.pi / 180, ANGLE)),
    "mrad": (1e-3, ANGLE),
    **dict.fromkeys(("rev", "turn", "turns"), (2 * math.pi, ANGLE)),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), (1.0, TIME)),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), (1e-3, TIME)),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), (1e-6, TIME)),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), (1e-9, TIME)),
    "min": (60.0, TIME),
    **dict.fromkeys(("N", "newton", "newtons"), (1.0, "N")),
    "mN": (1e-3, "N"),
    "kN": (1e3, "N"),
    **dict.fromkeys(("Nm", "N m", "N*m", "N.m", "N·m"), (1.0, "N m")),
    "kg": (1.0, "kg"),
    "g": (1e-3, "kg"),
    "Hz": (1.0, "1/s"),
    "A": (1.0, "A"),
    "V": (1.0, "V"),
    "W": (1.0, "W"),
    "Pa": (1.0, "Pa"),
}
_METRES = re.compile(r"(milli|centi|)met(?:re|er)s?")
_FACTOR = re.compile(r"(?P<symbol>.*?[^\d^])(?:\^?(?P<exponent>\d+))?")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as a multiple of an SI unit.

    Attributes:
        factor: Value in the SI unit of one unit.
        si: SI unit, such as "m" or "rad/s"; "1" for plain numbers.
    """

    factor: float
    si: str


def parse_unit(text: str, label: str = "unit") -> Unit:
    """Return the factor and the SI unit of a unit's text.

    Known are lengths (m, km, dm, cm, mm, um, in, ft), angles (rad, mrad, deg, rev), times (s, ms, us, ns,
    min), N, kN, mN, Nm, kg, g, Hz, A, V, W and Pa, with quotients and powers such as "mm/s" and "m/s^2".
    An empty text is the unit of plain numbers.

    Args:
        text: Unit.
        label: Meaning of the unit; the message begins with it.

    Raises:
        InvalidInput: If the text is not a known unit.

    Example:
        >>> parse_unit("mm/s")
        Unit(factor=0.001, si='m/s')
    """
    stripped = require_printable(text, label, max_length=60).strip()
    factors = [_parse_factor(part.strip()) for part in stripped.split("/")]
    if None in factors or (len(factors) > 1 and "" in stripped.split("/")):
        raise InvalidInput(
            f"{label} is {short_repr(text)}, which is unknown; expected a unit such as m, mm, rad, deg, s, "
            'ms, N or mm/s; pass "" for plain numbers'
        )
    parsed = [factor for factor in factors if factor is not None]
    value = parsed[0].factor
    for divisor in parsed[1:]:
        value /= divisor.factor
    return Unit(value, "/".join(factor.si for factor in parsed))


def is_unit(text: str) -> bool:
    """Return whether `parse_unit` knows a unit.

    Args:
        text: Unit.
    """
    try:
        parse_unit(text)
    except InvalidInput:
        return False
    return True


def _parse_factor(text: str) -> Unit | None:
    """Return a symbol with an optional exponent; None if it is unknown."""
    if match := _METRES.fullmatch(text.lower()):
        return Unit(*SYMBOLS[{"milli": "mm", "centi": "cm"}.get(match[1], "m")])
    if known := SYMBOLS.get(text) or SYMBOLS.get(text.lower()):
        return Unit(*known)
    match = _FACTOR.fullmatch(text)
    if match is None or not match["exponent"] or len(match["exponent"]) > 1:
        return None
    known, exponent = SYMBOLS.get(match["symbol"].strip()), int(match["exponent"])
    if known is None or not 1 <= exponent <= MAX_EXPONENT:
        return None
    return Unit(known[0] ** exponent, known[1] if exponent == 1 else f"{known[1]}^{exponent}")
