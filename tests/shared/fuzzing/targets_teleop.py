"""Targets of the teleoperation messages: decoders, and datagrams at both sites."""

from collections.abc import Callable
from random import Random
from typing import Any

from teleop_endpoints import KEYS, connect, new_operator, new_robot, without_audit
from teleop_messages import EXAMPLES, mutate

from fuzzing.soundness import InvariantViolation, require_sound
from fuzzing.target import Target
from pilotfish.teleop import Kind, MalformedMessage, decode, encode, receive_at_operator, receive_at_robot
from pilotfish.teleop.endpoints import TO_ROBOT
from pilotfish.teleop.messages import ROBOT, SkillStatus, Welcome
from pilotfish.teleop.seal import Header, seal_datagram

Base = tuple[Kind, bytes, bool]  # bytes of a message, or of its datagram if they are sealed


def _edit(value: Base, rng: Random) -> tuple[Base, str]:
    kind, data, is_sealed = value
    if rng.random() < 0.2:
        data = data[: rng.randrange(len(data) + 1)] if rng.random() < 0.5 else data + b"\0"
        return (kind, data, is_sealed), f"{kind.name}: {len(data)} bytes"
    return (kind, mutate(data, rng), is_sealed), f"{kind.name}: bytes"


def _use_message(value: Any, thorough: bool) -> None:
    kind, message = value
    if not isinstance(message, SkillStatus | Welcome):  # they have whole numbers of 1024 and 64 bits
        require_sound(message)
    if decode(kind, encode(message)) != message:
        raise InvariantViolation("the message that is read differs from the one that was written")


def _messages() -> Target:
    bases = [(kind, encode(message), False) for kind, message in EXAMPLES.items()]
    return Target(bases, _edit, lambda base: base, lambda b: (b[0], decode(b[0], b[1])), _use_message)


def _datagrams() -> Target:
    """Return a target in which half of the bases are sealed after they were edited."""
    robot, operator = connect(new_robot(), new_operator())

    def sealed(kind: Kind, payload: bytes) -> bytes:
        header = Header(kind, 1 if kind in TO_ROBOT else ROBOT, 11, 1, 9)
        return seal_datagram(KEYS[1], header, payload)

    def read(datagram: bytes) -> None:
        after, received, replies = receive_at_robot(robot, [datagram])
        if not received and not replies and after.audit != robot.audit:
            if without_audit(after) != without_audit(robot):
                raise InvariantViolation("a refused datagram changed the robot's endpoint")
            _, received = receive_at_operator(operator, [datagram])
        if not received and not replies:
            raise MalformedMessage("both sites refused the datagram")

    bases = [(kind, encode(message), False) for kind, message in EXAMPLES.items()]
    bases += [(kind, sealed(kind, payload), True) for kind, payload, _ in bases]
    return Target(
        bases, _edit, lambda b: b[1] if b[2] else sealed(b[0], b[1]), read, lambda value, thorough: None
    )


TARGETS: dict[str, tuple[Callable[[], Target], float]] = {
    "messages": (_messages, 2.0),
    "datagrams": (_datagrams, 2.0),
}
