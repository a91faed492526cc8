"""Bytes of the messages: one layout of fixed size per kind, little endian, without padding between fields.

Numbers that are not finite are refused first. `encode` decodes what it wrote, so it refuses what the receiver
would refuse. Encoding a decoded message gives the same bytes, with one exception: a quaternion whose norm is
not 1 (within 1e-3) is normalised. Decoding those bytes gives the same message.
"""

from dataclasses import dataclass, fields
from enum import IntEnum
from math import isfinite
from struct import Struct, error
from typing import Any

from pilotfish.teleop import wire_fields as wire
from pilotfish.teleop.errors import MalformedMessage
from pilotfish.teleop.messages import (
    MAX_MISSION,
    MAX_PIECES,
    PIECE_SIZE,
    CommandMessage,
    Envelope,
    Hello,
    Message,
    Mission,
    Refusal,
    Report,
    ReportedFrame,
    Request,
    SkillPiece,
    SkillState,
    SkillStatus,
    Stop,
    Welcome,
)
from pilotfish.teleop.session import Action, Reason, SessionState


class Kind(IntEnum):
    """Kind of a message, as in the header of its datagram."""

    HELLO = 1
    WELCOME = 2
    COMMAND = 3
    REQUEST = 4
    STOP = 5
    MISSION = 6
    SKILL_PIECE = 7
    SKILL_STATUS = 8
    REPORT = 9


PRIORITIES: dict[Kind, int] = {  # 0 is sent first
    Kind.STOP: 0,
    Kind.HELLO: 1,
    Kind.WELCOME: 1,
    Kind.REQUEST: 1,
    Kind.COMMAND: 2,
    Kind.MISSION: 3,
    Kind.SKILL_PIECE: 3,
    Kind.SKILL_STATUS: 4,
    Kind.REPORT: 4,
}


@dataclass(frozen=True, slots=True)
class Layout:
    """Bytes of one kind.

    Attributes:
        message: Class of the message.
        fields: Name and type of each attribute but the flags, in the order of the bytes.
        flags: Names of the attributes that share the last byte, from its lowest bit.
        slices: For each of `fields`, its slice of all values.
        floats: Positions of the values that are floats.
        struct: All values.
    """

    message: type
    fields: tuple[tuple[str, wire.Field], ...]
    flags: tuple[str, ...]
    slices: tuple[slice, ...]
    floats: tuple[int, ...]
    struct: Struct


def _layout(message: type, *flags: str, **types: wire.Field) -> Layout:
    """Lay out the attributes of a message one after another."""
    codes: list[str] = []
    slices = []
    for each in types.values():
        slices.append(slice(len(codes), len(codes) + len(each.codes)))
        codes += each.codes
    codes += ["B"] * bool(flags)
    floats = tuple(n for n, code in enumerate(codes) if code == "f")
    return Layout(message, tuple(types.items()), flags, tuple(slices), floats, Struct("<" + "".join(codes)))


LAYOUTS: dict[Kind, Layout] = {
    Kind.HELLO: _layout(Hello),
    Kind.WELCOME: _layout(
        Welcome, boot=wire.U64, connection=wire.U32, max_budget=wire.TIME, max_jitter=wire.TIME
    ),
    Kind.COMMAND: _layout(
        CommandMessage,
        "is_clutch_closed",
        "is_dead_man_pressed",
        number=wire.U32,
        report=wire.U32,
        lease=wire.U32,
        valid=wire.VALID,
        pose=wire.POSE,
        twist=wire.TWIST,
        grip=wire.SHARE,
        mode=wire.MODE,
        skill=wire.SKILL_INDEX,
    ),
    Kind.REQUEST: _layout(
        Request,
        number=wire.U32,
        action=wire.enumeration(Action),
        budget=wire.TIME,
        jitter=wire.TIME,
        envelope=wire.ENVELOPE,
    ),
    Kind.STOP: _layout(Stop, number=wire.U32),
    Kind.MISSION: _layout(Mission, number=wire.U32, skills=wire.HASHES),
    Kind.SKILL_PIECE: _layout(SkillPiece, hash=wire.HASH, size=wire.U32, index=wire.U16, data=wire.DATA),
    Kind.SKILL_STATUS: _layout(
        SkillStatus, hash=wire.HASH, state=wire.enumeration(SkillState), received=wire.RECEIVED
    ),
    Kind.REPORT: _layout(
        Report,
        "is_link_lost",
        "is_authorised",
        "is_plan_moving",
        "is_clutch_closed",
        "is_limited",
        number=wire.U32,
        state=wire.enumeration(SessionState),
        reason=wire.enumeration(Reason),
        mode=wire.MODE,
        refusal=wire.enumeration(Refusal),
        skill=wire.number("B", 0, MAX_MISSION),
        holder=wire.U16,
        lease=wire.U32,
        request=wire.U32,
        request_refusal=wire.enumeration(Refusal),
        stop=wire.U32,
        mission=wire.U32,
        command=wire.U32,
        command_age=wire.TIME,
        loop_age=wire.TIME,
        budget=wire.TIME,
        jitter=wire.TIME,
        stale=wire.U32,
        pose=wire.POSE,
        twist=wire.TWIST,
        grip=wire.SHARE,
        target=wire.POSE,
        covariance=wire.COVARIANCE,
        authority=wire.SHARE,
        misalignment=wire.MISALIGNMENT,
        envelope_left=wire.TIME,
        skill_state=wire.U16,
        probability=wire.SHARE,
        frames=wire.FRAMES,
    ),
}
KINDS: dict[type, Kind] = {layout.message: kind for kind, layout in LAYOUTS.items()}


def kind_of(message: Message) -> Kind:
    """Return the kind of a message.

    Args:
        message: Any message.

    Raises:
        MalformedMessage: If it is not a message.
    """
    kind = KINDS.get(type(message))
    if kind is None:
        raise MalformedMessage(f"message is of type {type(message).__name__}, expected a message of teleop")
    return kind


def priority(kind: int) -> int:
    """Return the priority of a kind; 0 is the highest.

    Args:
        kind: Number of the kind, as in `Kind`.

    Raises:
        MalformedMessage: If the kind is unknown.
    """
    return PRIORITIES[_known(kind)]


def payload_size(kind: int) -> int:
    """Return the number of bytes of a message of one kind.

    Args:
        kind: Number of the kind, as in `Kind`.

    Raises:
        MalformedMessage: If the kind is unknown.
    """
    return LAYOUTS[_known(kind)].struct.size


def encode(message: Message) -> bytes:
    """Return the bytes of a message.

    Args:
        message: Message; numbers are rounded to single precision, `valid` to milliseconds.

    Raises:
        MalformedMessage: If a value cannot be sent.
    """
    kind = kind_of(message)
    layout = LAYOUTS[kind]
    for name, _ in layout.fields:
        _require_finite(name, getattr(message, name))
    try:
        values: list[Any] = []
        for name, each in layout.fields:
            values += each.to_values(name, getattr(message, name))
        if layout.flags:
            values.append(sum(bool(getattr(message, name)) << n for n, name in enumerate(layout.flags)))
        payload = layout.struct.pack(*values)
    except (error, OverflowError, TypeError, ValueError) as problem:
        raise MalformedMessage(
            f"{layout.message.__name__} has a value that cannot be sent: {problem}"
        ) from problem
    decode(kind, payload)
    return payload


def decode(kind: int, payload: bytes) -> Message:
    """Return the message that bytes contain.

    Args:
        kind: Number of the kind, as in `Kind`.
        payload: Bytes of the message.

    Raises:
        MalformedMessage: If the kind is unknown, the length is wrong, or a value is not allowed.
    """
    layout = LAYOUTS[_known(kind)]
    if len(payload) != layout.struct.size:
        raise MalformedMessage(
            f"{layout.message.__name__} has {len(payload)} bytes, expected {layout.struct.size}"
        )
    values = layout.struct.unpack(payload)
    if not all(map(isfinite, map(values.__getitem__, layout.floats))):
        for (name, _), part in zip(layout.fields, layout.slices, strict=True):
            _require_finite(name, values[part])
    attributes = {
        name: each.from_values(name, values[part])
        for (name, each), part in zip(layout.fields, layout.slices, strict=True)
    }
    if layout.flags:
        flags = wire.bits("flags", values[-1], len(layout.flags))
        attributes.update(zip(layout.flags, flags, strict=True))
    message: Message = layout.message(**attributes)
    if isinstance(message, SkillPiece):
        require_consistent(message)
    return message


def require_consistent(piece: SkillPiece) -> None:
    """Refuse a piece whose index or length contradicts the size of the skill.

    Args:
        piece: Piece.

    Raises:
        MalformedMessage: If it does.
    """
    if not 1 <= piece.size <= MAX_PIECES * PIECE_SIZE:
        raise MalformedMessage(f"size is {piece.size} bytes, expected 1 to {MAX_PIECES * PIECE_SIZE}")
    expected = min(PIECE_SIZE, piece.size - piece.index * PIECE_SIZE)
    if piece.index < 0 or expected <= 0:
        raise MalformedMessage(f"index is {piece.index}, expected a piece of a skill of {piece.size} bytes")
    if len(piece.data) != expected:
        raise MalformedMessage(
            f"data has {len(piece.data)} bytes, expected {expected} in piece {piece.index}"
        )


def _known(kind: int) -> Kind:
    try:
        return Kind(kind)
    except ValueError:
        raise MalformedMessage(f"kind is {kind}, expected {min(Kind)} to {max(Kind)}") from None


def _require_finite(name: str, value: Any) -> None:
    """Refuse numbers that are not finite, in tuples, frames and envelopes as well."""
    if isinstance(value, float):
        if not isfinite(value):
            raise MalformedMessage(f"{name} has a value of {value}, expected finite numbers")
    elif isinstance(value, tuple):
        for each in value:
            _require_finite(name, each)
    elif isinstance(value, Envelope | ReportedFrame):
        for attribute in fields(value):
            _require_finite(f"{name}.{attribute.name}", getattr(value, attribute.name))
