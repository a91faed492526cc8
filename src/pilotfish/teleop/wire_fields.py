"""Fields of messages: for each type of attribute, its values in bytes and the checks of values that arrive.

Unit quaternions. Rounding to single precision changes the norm by up to 1e-7. Decoding removes that change:
it keeps three of the rounded components, and computes one from them in float64 so that the norm is 1. That
one is the first component of at least 0.4; a unit quaternion has one of at least 0.5. Dividing by the norm
instead changes all components, and its result may round to other bytes than those that arrived.

`settle` repeats this until the component that was computed rounds to itself. Only that component changes. If
it falls below 0.4, a later one is chosen, so at most four are computed. Encoding a decoded quaternion
therefore gives the same bytes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import copysign, sqrt
from struct import Struct
from typing import Any

from pilotfish.teleop.errors import MalformedMessage
from pilotfish.teleop.messages import (
    HASH_SIZE,
    MAX_FRAMES,
    MAX_MISSION,
    MAX_PIECES,
    MODES,
    PIECE_SIZE,
    Envelope,
    Numbers,
    ReportedFrame,
)

NORM_TOLERANCE = 1e-3  # of a quaternion
ROUNDING = 1e-7  # of a norm, by single precision at most; one component of a settled one changes it by 3e-8
LEAST = 0.4  # of the component that is computed
MILLISECONDS = 1000
_FOUR, _SINGLE = Struct("<4f"), Struct("<f")


@dataclass(frozen=True, slots=True)
class Field:
    """Type of an attribute.

    Attributes:
        codes: Codes of `struct`, one per value.
        to_values: Returns the values of an attribute; its arguments are the name and the attribute.
        from_values: Checks values that arrived and returns the attribute.
    """

    codes: tuple[str, ...]
    to_values: Callable[[str, Any], Sequence[Any]]
    from_values: Callable[[str, Sequence[Any]], Any]


def settle(name: str, quaternion: Sequence[float]) -> Numbers:
    """Return the unit quaternion that keeps its bytes in single precision.

    Args:
        name: Name of the field, for the message.
        quaternion: Four numbers whose norm is within 1e-3 of 1.

    Raises:
        MalformedMessage: If the norm is another.
    """
    w, x, y, z = quaternion
    norm = sqrt(w * w + x * x + y * y + z * z)
    if not abs(norm - 1.0) <= NORM_TOLERANCE:
        raise MalformedMessage(f"{name} has a quaternion of norm {norm:g}, expected 1; normalise it")
    scale = norm if abs(norm - 1.0) > ROUNDING else 1.0
    parts = list(_FOUR.unpack(_FOUR.pack(w / scale, x / scale, y / scale, z / scale)))
    while True:
        chosen = next(n for n, part in enumerate(parts) if abs(part) >= LEAST)
        a, b, c = parts[:chosen] + parts[chosen + 1 :]
        exact = copysign(sqrt(1.0 - a * a - b * b - c * c), parts[chosen])
        (rounded,) = _SINGLE.unpack(_SINGLE.pack(exact))
        if rounded == parts[chosen]:
            parts[chosen] = exact
            return tuple(parts)
        parts[chosen] = rounded


def _require_length(name: str, value: Sequence[Any], length: int) -> None:
    if len(value) != length:
        raise MalformedMessage(f"{name} has {len(value)} items, expected {length}")


def _one(name: str, value: Any) -> Sequence[Any]:
    return (value,)


def _first(name: str, values: Sequence[Any]) -> Any:
    return values[0]


def number(code: str, lowest: float = float("-inf"), highest: float = float("inf"), unit: str = "") -> Field:
    """Return the type of one number.

    Args:
        code: Code of `struct`.
        lowest: Smallest value that is accepted.
        highest: Largest value that is accepted.
        unit: Unit, for the message.
    """

    def from_values(name: str, values: Sequence[Any]) -> Any:
        if not lowest <= values[0] <= highest:
            expected = f"{lowest:g} to {highest:g}" if highest < float("inf") else f"at least {lowest:g}"
            raise MalformedMessage(f"{name} is {values[0]:g}{unit}, expected {expected}{unit}")
        return values[0]

    return Field((code,), _one, from_values)


def vector(length: int) -> Field:
    """Return the type of a tuple of numbers in single precision."""

    def to_values(name: str, value: Sequence[float]) -> Sequence[float]:
        _require_length(name, value, length)
        return value

    return Field(("f",) * length, to_values, lambda name, values: tuple(values))


def _pose_to_values(name: str, value: Numbers) -> Numbers:
    _require_length(name, value, 7)
    return (*value[:3], *settle(name, value[3:]))


def _pose_from_values(name: str, values: Sequence[float]) -> Numbers:
    return (*values[:3], *settle(name, values[3:]))


def _sizes_from_values(name: str, values: Sequence[float]) -> Numbers:
    if min(values) < 0.0:
        raise MalformedMessage(f"{name} is {tuple(values)}, expected numbers that are at least 0")
    return tuple(values)


def enumeration(numbers: type[IntEnum]) -> Field:
    """Return the type of a member of an enumeration, in one byte."""
    members = {int(member): member for member in numbers}

    def from_values(name: str, values: Sequence[int]) -> IntEnum:
        if values[0] not in members:
            raise MalformedMessage(f"{name} is {values[0]}, expected 0 to {max(members)}")
        return members[values[0]]

    return Field(("B",), lambda name, value: (int(numbers(value)),), from_values)


def _mode_to_values(name: str, value: str) -> Sequence[int]:
    if value not in MODES:
        raise MalformedMessage(f"{name} is {value!r}, expected one of {', '.join(MODES)}")
    return (MODES.index(value),)


def _mode_from_values(name: str, values: Sequence[int]) -> str:
    if values[0] >= len(MODES):
        raise MalformedMessage(f"{name} is {values[0]}, expected 0 to {len(MODES) - 1}")
    return MODES[values[0]]


def _milliseconds_to_values(name: str, value: float) -> Sequence[int]:
    if not 0.0 <= round(value * MILLISECONDS) <= 0xFFFF:
        raise MalformedMessage(f"{name} is {value:g} s, expected 0 to 65.535 s")
    return (round(value * MILLISECONDS),)


def bits(name: str, value: int, count: int) -> tuple[bool, ...]:
    """Return the lowest bits of a byte, and refuse others.

    Args:
        name: Name of the field, for the message.
        value: Byte.
        count: Number of bits that have a meaning.
    """
    if value >> count:
        raise MalformedMessage(f"{name} is {value:#04x}, expected zero in all but the lowest {count} bits")
    return tuple(bool(value >> n & 1) for n in range(count))


def _envelope_to_values(name: str, value: Envelope) -> Sequence[Any]:
    _require_length(f"{name}.lower", value.lower, 3)
    _require_length(f"{name}.upper", value.upper, 3)
    modes = {_mode_to_values(f"{name}.modes", mode)[0] for mode in value.modes}
    return (value.duration, *value.lower, *value.upper, value.max_distance, sum(1 << n for n in modes))


def _envelope_from_values(name: str, values: Sequence[Any]) -> Envelope:
    duration, lower, upper, max_distance = values[0], tuple(values[1:4]), tuple(values[4:7]), values[7]
    if duration < 0.0 or max_distance < 0.0:
        raise MalformedMessage(
            f"{name} has {duration:g} s and distance {max_distance:g}, expected at least 0"
        )
    if duration > 0.0 and any(low >= high for low, high in zip(lower, upper, strict=True)):
        raise MalformedMessage(f"{name} has corners {lower} and {upper}, expected lower below upper")
    chosen = bits(f"{name}.modes", values[8], len(MODES))
    modes = tuple(mode for mode, is_chosen in zip(MODES, chosen, strict=True) if is_chosen)
    return Envelope(duration, lower, upper, max_distance, modes)


def _hash_to_values(name: str, value: bytes) -> Sequence[bytes]:
    _require_length(name, value, HASH_SIZE)
    return (value,)


def _require_count(name: str, count: int, most: int) -> None:
    if count > most:
        raise MalformedMessage(f"{name} has {count} items, expected at most {most}")


def _hashes_to_values(name: str, value: Sequence[bytes]) -> Sequence[Any]:
    _require_count(name, len(value), MAX_MISSION)
    for each in value:
        _require_length(name, each, HASH_SIZE)
    return (len(value), *value, *[b""] * (MAX_MISSION - len(value)))


def _hashes_from_values(name: str, values: Sequence[Any]) -> tuple[bytes, ...]:
    count = values[0]
    _require_count(name, count, MAX_MISSION)
    _require_zero(name, b"".join(values[1 + count :]))
    return tuple(values[1 : 1 + count])


def _require_zero(name: str, padding: bytes) -> None:
    if any(padding):
        raise MalformedMessage(f"{name} has padding that is not zero")


def _data_to_values(name: str, value: bytes) -> Sequence[Any]:
    _require_count(name, len(value), PIECE_SIZE)
    return len(value), value


def _data_from_values(name: str, values: Sequence[Any]) -> bytes:
    length, data = values
    _require_count(name, length, PIECE_SIZE)
    _require_zero(name, data[length:])
    return bytes(data[:length])


def _received_to_values(name: str, value: int) -> Sequence[bytes]:
    if not 0 <= value < 1 << MAX_PIECES:
        raise MalformedMessage(f"{name} has a bit beyond the {MAX_PIECES} pieces")
    return (value.to_bytes(MAX_PIECES // 8, "little"),)


def _frames_to_values(name: str, value: Sequence[ReportedFrame]) -> Sequence[Any]:
    _require_count(name, len(value), MAX_FRAMES)
    values: list[Any] = [len(value)]
    for each in value:
        values += (each.name, *_pose_to_values(name, each.pose))
    return values + [0] * (8 * (MAX_FRAMES - len(value)))


def _frames_from_values(name: str, values: Sequence[Any]) -> tuple[ReportedFrame, ...]:
    count = values[0]
    _require_count(name, count, MAX_FRAMES)
    rest = values[1 + 8 * count :]
    if any(rest) or any(copysign(1.0, each) < 0.0 for each in rest):  # -0.0 has a bit as well
        raise MalformedMessage(f"{name} has padding that is not zero")
    return tuple(
        ReportedFrame(values[n], _pose_from_values(name, values[n + 1 : n + 8]))
        for n in range(1, 1 + 8 * count, 8)
    )


U16 = Field(("H",), _one, _first)
U32 = Field(("I",), _one, _first)
U64 = Field(("Q",), _one, _first)
TIME = number("f", 0.0, unit=" s")
SHARE = number("f", 0.0, 1.0)
SKILL_INDEX = number("B", 0, MAX_MISSION - 1)
POSE = Field(("f",) * 7, _pose_to_values, _pose_from_values)
TWIST = vector(6)
COVARIANCE = vector(21)
MISALIGNMENT = Field(("f",) * 2, vector(2).to_values, _sizes_from_values)
MODE = Field(("B",), _mode_to_values, _mode_from_values)
VALID = Field(("H",), _milliseconds_to_values, lambda name, values: values[0] / MILLISECONDS)
ENVELOPE = Field((*["f"] * 8, "B"), _envelope_to_values, _envelope_from_values)
HASH = Field((f"{HASH_SIZE}s",), _hash_to_values, _first)
HASHES = Field(("B", *[f"{HASH_SIZE}s"] * MAX_MISSION), _hashes_to_values, _hashes_from_values)
DATA = Field(("H", f"{PIECE_SIZE}s"), _data_to_values, _data_from_values)
RECEIVED = Field(
    (f"{MAX_PIECES // 8}s",), _received_to_values, lambda name, values: int.from_bytes(values[0], "little")
)
FRAMES = Field(("B", *["I", *["f"] * 7] * MAX_FRAMES), _frames_to_values, _frames_from_values)
