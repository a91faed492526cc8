"""Replay of a recorded session: the robot's site again, compared bit for bit with what was recorded."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import zip_longest
from typing import Any

from pilotfish.teleop.codec import kind_of
from pilotfish.teleop.errors import MalformedMessage
from pilotfish.teleop.messages import OutgoingMessage, ReceivedMessage
from pilotfish.teleop.robot_site import RobotSite, start_robot
from pilotfish.teleop.robot_step import RobotStep, step_robot
from pilotfish.teleop.robot_values import RobotSettings, RobotState
from pilotfish.teleop.session import Reason, SessionState
from pilotfish.teleop.session_record import (
    CHANNELS,
    RECEIVED,
    SENSED,
    SENT,
    START,
    RecordedStep,
    decode_received,
    decode_sensed,
    decode_sent,
    decode_target,
    encode_sent,
    encode_target,
)
from pilotfish.validation import short_repr, shorten_repr

NUMBERS = (
    *(f"pose {name}" for name in ("x", "y", "z", "qw", "qx", "qy", "qz")),
    *(f"velocity {name}" for name in ("x", "y", "z")),
    *(f"angular velocity {name}" for name in ("x", "y", "z")),
    "grip",
)


@dataclass(frozen=True, slots=True)
class Difference:
    """First difference between a recording and its replay.

    Attributes:
        time_ns: Time of the step on the robot's clock [ns].
        field: What differs, such as "target pose x" or "report to 1: authority".
        recorded: Recorded value.
        replayed: Value of the replay.
    """

    time_ns: int
    field: str
    recorded: str
    replayed: str


@shorten_repr
@dataclass(frozen=True, slots=True)
class Replay:
    """Result of a replay.

    Attributes:
        steps: Number of steps that were compared; the last one differs if there is a difference.
        messages: Number of messages in these steps, received and sent.
        time_ns: Time of the last of these steps on the robot's clock [ns].
        difference: First difference; None if all targets and messages are identical.
        left_over: Number of records of a last step that is incomplete.
    """

    steps: int
    messages: int
    time_ns: int
    difference: Difference | None
    left_over: int = 0


def replay_records(settings: RobotSettings, records: Iterable[tuple[str, int, bytes]]) -> Replay:
    """Repeat the steps of a recorded robot site and compare each target and each message that was sent.

    Records of other channels are skipped.

    Args:
        settings: Settings with which the session was recorded.
        records: Channel, time [ns] and bytes of each record, in their order.

    Returns:
        What was compared, up to the first difference.

    Raises:
        MalformedMessage: If a record is damaged, or the first one is not a start.
        InvalidInput: If the recorded start is not possible.
    """
    site: RobotSite | None = None
    steps = messages = time_ns = left_over = 0
    for item in _group_steps(records):
        if isinstance(item, int):
            left_over = item
        elif not isinstance(item, RecordedStep):
            site = start_robot(settings, *item)
        elif site is None:
            raise MalformedMessage("the recording does not begin with a start of the robot; record it again")
        else:
            step = step_robot(settings, site, item.time_ns, item.received, item.robot)
            site, time_ns = step.site, item.time_ns
            steps, messages = steps + 1, messages + len(item.received) + len(item.sent)
            if (difference := _compare(item, step)) is not None:
                return Replay(steps, messages, time_ns, difference)
    return Replay(steps, messages, time_ns, None, left_over)


def _group_steps(
    records: Iterable[tuple[str, int, bytes]],
) -> Iterator[RecordedStep | tuple[int, RobotState] | int]:
    """Yield starts and steps, and at the end the number of records of an incomplete step."""
    received: list[ReceivedMessage] = []
    sent: list[bytes] = []
    robot: RobotState | None = None
    for channel, time_ns, data in records:
        if channel not in CHANNELS:
            continue
        if channel == START:
            yield time_ns, decode_sensed(data)
        elif channel == RECEIVED:
            received.append(decode_received(data))
        elif channel == SENSED:
            robot = decode_sensed(data)
        elif channel == SENT:
            sent.append(data)
        elif robot is None:
            raise MalformedMessage(f"the step at {time_ns} ns has no record of {SENSED}; record it again")
        else:
            yield RecordedStep(time_ns, tuple(received), robot, tuple(sent), data)
            received, sent, robot = [], [], None
    yield len(received) + len(sent) + (robot is not None)


def _compare(recorded: RecordedStep, step: RobotStep) -> Difference | None:
    """Return the first difference of a step."""
    if recorded.target != encode_target(step):
        return Difference(recorded.time_ns, *_compare_targets(recorded.target, encode_target(step)))
    sent = tuple(encode_sent(each) for each in step.outgoing)
    for before, after in zip_longest(recorded.sent, sent):
        if before != after:
            return Difference(recorded.time_ns, *_compare_messages(before, after))
    return None


def _compare_targets(before: bytes, after: bytes) -> tuple[str, str, str]:
    *recorded, numbers = decode_target(before)
    *replayed, others = decode_target(after)
    for name, old, new in zip(("time", "state", "reason"), recorded, replayed, strict=True):
        if old != new:
            return name, _name_value(name, old), _name_value(name, new)
    for name, old, new in zip(NUMBERS, numbers, others, strict=True):
        if old.tobytes() != new.tobytes():
            return f"target {name}", repr(float(old)), repr(float(new))
    return "target", before.hex(), after.hex()


def _name_value(name: str, number: int) -> str:
    kind = {"state": SessionState, "reason": Reason}.get(name)
    if kind is None:
        return f"{number} ns"
    return kind(number).name if number in {int(each) for each in kind} else str(number)


def _compare_messages(before: bytes | None, after: bytes | None) -> tuple[str, str, str]:
    """Return what differs between two messages; one of them may be missing."""
    old, new = (None if data is None else decode_sent(data) for data in (before, after))
    if (
        old is None
        or new is None
        or (old.receiver, kind_of(old.message))
        != (
            new.receiver,
            kind_of(new.message),
        )
    ):
        return "message", _name_message(old), _name_message(new)
    for each in fields(old.message):
        values = getattr(old.message, each.name), getattr(new.message, each.name)
        if repr(values[0]) != repr(values[1]):
            return f"{_name_message(old)}: {each.name}", *_shorten(*values)
    return _name_message(old), str(before), str(after)


def _name_message(outgoing: OutgoingMessage | None) -> str:
    if outgoing is None:
        return "none"
    return f"{kind_of(outgoing.message).name.lower().replace('_', ' ')} to {outgoing.receiver}"


def _shorten(old: Any, new: Any) -> tuple[str, str]:
    """Return two values; of tuples of equal length the first items that differ."""
    if isinstance(old, tuple) and isinstance(new, tuple) and len(old) == len(new):
        old, new = next(pair for pair in zip(old, new, strict=True) if repr(pair[0]) != repr(pair[1]))
    return short_repr(old), short_repr(new)
