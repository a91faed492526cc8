"""Records of a session: all that the robot's site receives, senses, sends and commands, as bytes.

A step of the robot is written as records of equal time, which is that of the robot's clock, in this order:

    robot/received   each message that the step was given: sender, connection, kind, payload
    robot/sensed     what the robot senses: float64 numbers, and the poses of objects by name
    robot/sent       each message that the step sends: receiver, kind, payload
    robot/target     what the arm shall do: time, state, reason, float64 numbers; it ends the step

`robot/start` begins the session, and again each new start of the robot's site. Payloads are plaintext from
`encode`; keys and seals are not recorded. Skills arrive as messages. With the settings of the robot's site,
as JSON, the records determine every target and every message (`replay`): `step_robot` is a pure function, and
decoding the payload of a received message gives the same message.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct, error
from typing import Protocol, runtime_checkable

import numpy as np

from pilotfish.geometry import Pose
from pilotfish.teleop.codec import decode, encode, kind_of
from pilotfish.teleop.errors import MalformedMessage
from pilotfish.teleop.messages import VERSION, OutgoingMessage, ReceivedMessage
from pilotfish.teleop.robot_step import RobotStep
from pilotfish.teleop.robot_values import RobotSettings, RobotState
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

START, RECEIVED, SENSED, SENT, TARGET = (
    f"robot/{name}" for name in ("start", "received", "sensed", "sent", "target")
)
CHANNELS = (START, RECEIVED, SENSED, SENT, TARGET)
Records = list[tuple[str, bytes]]
RECORD_VERSIONS = {"recording": "1", "messages": str(VERSION)}
"""Versions of the records and of the messages, by name."""

_RECEIVED, _SENT, _TARGET = Struct("<HIB"), Struct("<HB"), Struct("<QBB")
_SENSED, _NAME, _POSE, _COUNT = Struct("<14dB"), Struct("<H"), Struct("<7d"), Struct("<H")
_HAS_FRAMES, _HAS_REPORTED = 1, 2
TARGET_NUMBERS = 14  # pose, velocity, grip


@runtime_checkable
class RobotRecorder(Protocol):
    """What records the robot's site of a session; it must not raise an exception."""

    def start(self, settings: RobotSettings, time_ns: int, robot: RobotState) -> None:
        """Record a start of the robot's site.

        Args:
            settings: Settings of the site.
            time_ns: Time of the robot's clock [ns].
            robot: What the robot senses.
        """

    def record(self, received: tuple[ReceivedMessage, ...], robot: RobotState, step: RobotStep) -> None:
        """Record a step.

        Args:
            received: Messages that the step was given.
            robot: What the robot senses.
            step: Result of the step.
        """


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RecordedStep:
    """Step of the robot's site as it was recorded.

    Attributes:
        time_ns: Time of the robot's clock [ns].
        received: Messages that the step was given.
        robot: What the robot sensed.
        sent: Bytes of each message that the step sent, as in `encode_sent`.
        target: Bytes of the target, as in `encode_target`.
    """

    time_ns: int
    received: tuple[ReceivedMessage, ...]
    robot: RobotState
    sent: tuple[bytes, ...]
    target: bytes


def encode_start(robot: RobotState) -> tuple[str, bytes]:
    """Return the record of a start of the robot's site: channel and bytes.

    Args:
        robot: What the robot senses.
    """
    return START, encode_sensed(robot)


def encode_step(received: Sequence[ReceivedMessage], robot: RobotState, step: RobotStep) -> Records:
    """Return the records of a step: channel and bytes of each.

    Args:
        received: Messages that the step was given.
        robot: What the robot senses.
        step: Result of the step; its time is `step.site.time`.

    Raises:
        MalformedMessage: If a message cannot be sent.
    """
    return [
        *((RECEIVED, _encode_received(each)) for each in received),
        (SENSED, encode_sensed(robot)),
        *((SENT, encode_sent(each)) for each in step.outgoing),
        (TARGET, encode_target(step)),
    ]


def encode_sent(outgoing: OutgoingMessage) -> bytes:
    """Return receiver, kind and payload of a message that is sent.

    Args:
        outgoing: Message.

    Raises:
        MalformedMessage: If it cannot be sent.
    """
    message = outgoing.message
    return _pack(_SENT, outgoing.receiver, kind_of(message)) + encode(message)


def decode_sent(data: bytes) -> OutgoingMessage:
    """Return the message that `encode_sent` encoded.

    Args:
        data: Bytes of the record.

    Raises:
        MalformedMessage: If they are damaged.
    """
    receiver, kind = _unpack(_SENT, data, SENT)
    return OutgoingMessage(receiver, decode(kind, data[_SENT.size :]))


def encode_target(step: RobotStep) -> bytes:
    """Return time, state, reason, pose, velocity and grip of a step.

    Args:
        step: Result of the step.

    Raises:
        MalformedMessage: If a value is out of range.
    """
    site, target = step.site, step.target
    numbers = np.array([*target.pose, *target.velocity, target.grip], dtype="<f8")
    return _pack(_TARGET, site.time, site.control.state, site.control.reason) + numbers.tobytes()


def decode_target(data: bytes) -> tuple[int, int, int, Float[Array, " 14"]]:
    """Return time [ns], number of the state, number of the reason, and the numbers of a target.

    Args:
        data: Bytes from `encode_target`.

    Raises:
        MalformedMessage: If they are damaged.
    """
    time_ns, state, reason = _unpack(_TARGET, data, TARGET)
    if len(data) != _TARGET.size + 8 * TARGET_NUMBERS:
        raise _malformed(TARGET, len(data))
    return time_ns, state, reason, np.frombuffer(data[_TARGET.size :], "<f8").astype(float)


def decode_received(data: bytes) -> ReceivedMessage:
    """Return a received message.

    Args:
        data: Bytes of the record.

    Raises:
        MalformedMessage: If they are damaged.
    """
    sender, connection, kind = _unpack(_RECEIVED, data, RECEIVED)
    return ReceivedMessage(sender, decode(kind, data[_RECEIVED.size :]), connection)


def encode_sensed(robot: RobotState) -> bytes:
    """Return what the robot senses, bit for bit.

    Args:
        robot: What the robot senses.
    """
    flags = _HAS_FRAMES * (robot.frames is not None) + _HAS_REPORTED * (robot.reported is not None)
    parts = [_pack(_SENSED, *robot.pose, *robot.twist, robot.grip, flags)]
    for poses in (robot.frames, robot.reported):
        if poses is None:
            continue
        parts.append(_pack(_COUNT, len(poses)))
        for name, pose in poses.items():
            text = name.encode()
            parts += [_pack(_NAME, len(text)), text, _pack(_POSE, *pose.position, *pose.quaternion)]
    return b"".join(parts)


def decode_sensed(data: bytes) -> RobotState:
    """Return what the robot sensed.

    Args:
        data: Bytes from `encode_sensed`.

    Raises:
        MalformedMessage: If they are damaged.
    """
    *numbers, flags = _unpack(_SENSED, data, SENSED)
    position, poses = _SENSED.size, []
    for flag in (_HAS_FRAMES, _HAS_REPORTED):
        found, position = _decode_poses(data, position) if flags & flag else (None, position)
        poses.append(found)
    if position != len(data) or flags > _HAS_FRAMES + _HAS_REPORTED:
        raise _malformed(SENSED, len(data))
    return RobotState(np.array(numbers[:7]), np.array(numbers[7:13]), numbers[13], poses[0], poses[1])


def _decode_poses(data: bytes, position: int) -> tuple[dict[str, Pose], int]:
    """Return poses by name, and the position behind them."""
    (count,) = _unpack(_COUNT, data, SENSED, position)
    position += _COUNT.size
    poses = {}
    for _ in range(count):
        (length,) = _unpack(_NAME, data, SENSED, position)
        position += _NAME.size
        try:
            name = data[position : position + length].decode()
        except UnicodeDecodeError:
            raise _malformed(SENSED, len(data)) from None
        numbers = _unpack(_POSE, data, SENSED, position + length)
        position += length + _POSE.size
        poses[name] = Pose(np.array(numbers[:3]), np.array(numbers[3:]))
    return poses, position


def _encode_received(received: ReceivedMessage) -> bytes:
    message = received.message
    return _pack(_RECEIVED, received.sender, received.connection, kind_of(message)) + encode(message)


def _pack(layout: Struct, *values: object) -> bytes:
    """Return the bytes of some values, or raise MalformedMessage if they cannot be recorded."""
    try:
        return layout.pack(*values)
    except error as fault:
        raise MalformedMessage(f"a value cannot be recorded: {fault}") from fault


def _unpack(layout: Struct, data: bytes, channel: str, position: int = 0) -> tuple[int, ...]:
    try:
        return layout.unpack_from(data, position)
    except error:
        raise _malformed(channel, len(data)) from None


def _malformed(channel: str, size: int) -> MalformedMessage:
    return MalformedMessage(f"a record of {channel} has {size} bytes that cannot be read; record it again")
