"""Authenticated channel between operators and the robot, as pure functions of each site's state.

Handshake. An operator draws a challenge of 64 bits and sends Hello with it, under connection 0. The robot
assigns the next number of a connection and answers Welcome, under a key that the challenge enters. The
operator then uses that connection; with its first message, the robot changes to it, too. An older connection
of the peer is refused from then on. An operator that has nothing to say sends Hello under the new connection.

Invariants.
    A refused datagram changes the audit only.
    No datagram is accepted twice; one that was overtaken by up to 1023 others is accepted.
    A hello that is repeated costs one Welcome; the connection in use stays.
    No pair of key and sequence seals two messages. For this, each state may be used for one step only, each
    start of the robot needs another random `boot`, and each start of an operator another random `seed`.
    No clock changes the bytes: hellos are repeated by calls, not by time.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from pilotfish.errors import InvalidInput
from pilotfish.teleop.channels import Channel, OperatorEndpoint, RobotEndpoint
from pilotfish.teleop.codec import Kind, decode, encode, kind_of
from pilotfish.teleop.datagram_checks import Cause
from pilotfish.teleop.errors import MalformedMessage, SequenceExhausted, Unauthentic
from pilotfish.teleop.messages import ROBOT, Hello, Message, OutgoingMessage, ReceivedMessage, Welcome
from pilotfish.teleop.seal import MAX_SEQUENCE, Header, open_datagram, read_header, seal_datagram

HELLO_STEPS = 25  # calls of send between hellos
SILENT_STEPS = 150  # calls of receive without a valid datagram, after which the operator says hello again
MAX_CONNECTION = 2**32 - 1
TO_ROBOT = (Kind.HELLO, Kind.COMMAND, Kind.REQUEST, Kind.STOP, Kind.MISSION, Kind.SKILL_PIECE)
TO_OPERATOR = (Kind.WELCOME, Kind.SKILL_STATUS, Kind.REPORT)


class _Refused(Exception):
    def __init__(self, sender: int, cause: Cause) -> None:
        super().__init__(cause.name)
        self.sender, self.cause = sender, cause


def receive_at_robot(
    endpoint: RobotEndpoint, datagrams: Sequence[bytes]
) -> tuple[RobotEndpoint, tuple[ReceivedMessage, ...], tuple[tuple[int, bytes], ...]]:
    """Open datagrams that arrived at the robot.

    Args:
        endpoint: State of the channels.
        datagrams: Any bytes, in the order of their arrival.

    Returns:
        State, accepted messages, and replies to be sent: number of the peer, and datagram.
    """
    received: list[ReceivedMessage] = []
    replies: list[tuple[int, bytes]] = []
    for datagram in datagrams:
        try:
            header, message = _open_at_robot(endpoint, datagram)
        except _Refused as refused:
            endpoint = replace(endpoint, audit=endpoint.audit.add(refused.sender, refused.cause))
            continue
        if header.connection == 0:
            endpoint, reply = _welcome(endpoint, header)
            replies.append((header.sender, reply))
            continue
        channel = endpoint.channels[header.sender]
        if header.connection != channel.connection:
            channel = Channel(channel.peer, header.connection, channel.assigned)
        endpoint = _with_channel(endpoint, replace(channel, window=channel.window.add(header.sequence)))
        if not isinstance(message, Hello):
            received.append(ReceivedMessage(header.sender, message, header.connection))
    return endpoint, tuple(received), tuple(replies)


def send_from_robot(
    endpoint: RobotEndpoint, outgoing: Sequence[OutgoingMessage]
) -> tuple[RobotEndpoint, tuple[tuple[int, bytes], ...]]:
    """Seal messages of the robot; a peer without a connection gets nothing.

    Args:
        endpoint: State of the channels.
        outgoing: Messages and their receivers.

    Returns:
        State, and for each datagram the number of the peer.

    Raises:
        InvalidInput: If a receiver is not a peer, or the robot does not send messages of this kind.
        MalformedMessage: If a message cannot be sent.
        SequenceExhausted: If a connection has no sequence left.
    """
    sent: list[tuple[int, bytes]] = []
    for each in outgoing:
        channel = endpoint.channels.get(each.receiver)
        if channel is None:
            raise InvalidInput(f"receiver is {each.receiver}, expected one of {sorted(endpoint.channels)}")
        kind = _require_kind(each.message, (Kind.SKILL_STATUS, Kind.REPORT))
        payload = encode(each.message)
        if channel.connection:
            _require_sequence(channel.sequence)
            header = Header(kind, ROBOT, endpoint.boot, channel.connection, channel.sequence)
            sent.append((each.receiver, seal_datagram(channel.peer.key, header, payload)))
            endpoint = _with_channel(endpoint, replace(channel, sequence=channel.sequence + 1))
    return endpoint, tuple(sent)


def receive_at_operator(
    endpoint: OperatorEndpoint, datagrams: Sequence[bytes]
) -> tuple[OperatorEndpoint, tuple[ReceivedMessage, ...]]:
    """Open datagrams that arrived at an operator; a silent robot is greeted again.

    Args:
        endpoint: State of the channel.
        datagrams: Any bytes, in the order of their arrival.

    Returns:
        State, and accepted messages; the welcome of each connection is one of them.
    """
    received: list[ReceivedMessage] = []
    for datagram in datagrams:
        try:
            header, message = _open_at_operator(endpoint, datagram)
        except _Refused as refused:
            endpoint = replace(endpoint, audit=endpoint.audit.add(refused.sender, refused.cause))
            continue
        if isinstance(message, Welcome):
            endpoint = OperatorEndpoint(
                endpoint.number,
                endpoint.key,
                endpoint.seed,
                header.boot,
                header.connection,
                endpoint.challenges,
                is_greeting=False,
                hellos=endpoint.hellos,
                audit=endpoint.audit,
            )
        else:
            window = endpoint.window.add(header.sequence)
            endpoint = replace(endpoint, window=window, is_confirmed=True, is_greeting=False)
        received.append(ReceivedMessage(ROBOT, message))
    silent_calls = 0 if received else min(endpoint.silent_calls + 1, SILENT_STEPS)
    endpoint = replace(endpoint, silent_calls=silent_calls)
    if silent_calls == SILENT_STEPS and not endpoint.is_greeting:
        challenges = endpoint.challenges + 1
        endpoint = replace(endpoint, challenges=challenges, is_greeting=True, send_calls=0, silent_calls=0)
    return endpoint, tuple(received)


def send_from_operator(
    endpoint: OperatorEndpoint, messages: Sequence[Message]
) -> tuple[OperatorEndpoint, tuple[bytes, ...]]:
    """Seal messages of an operator, and hellos; without a connection, the messages are dropped.

    Args:
        endpoint: State of the channel.
        messages: Messages to the robot.

    Returns:
        State, and datagrams.

    Raises:
        InvalidInput: If an operator does not send messages of this kind.
        MalformedMessage: If a message cannot be sent.
        SequenceExhausted: If the connection has no sequence left.
    """
    sent: list[bytes] = []
    is_due = endpoint.send_calls % HELLO_STEPS == 0
    endpoint = replace(endpoint, send_calls=(endpoint.send_calls + 1) % HELLO_STEPS)
    if endpoint.is_greeting and is_due:
        _require_sequence(endpoint.hellos)
        header = Header(Kind.HELLO, endpoint.number, _challenge(endpoint), 0, endpoint.hellos)
        sent.append(seal_datagram(endpoint.key, header, encode(Hello())))
        endpoint = replace(endpoint, hellos=endpoint.hellos + 1)
    confirmation = () if endpoint.is_confirmed or messages or not is_due else (Hello(),)
    for message in (*confirmation, *messages):
        kind = _require_kind(message, TO_ROBOT)
        payload = encode(message)
        if endpoint.connection:
            _require_sequence(endpoint.sequence)
            header = Header(kind, endpoint.number, endpoint.boot, endpoint.connection, endpoint.sequence)
            sent.append(seal_datagram(endpoint.key, header, payload))
            endpoint = replace(endpoint, sequence=endpoint.sequence + 1)
    return endpoint, tuple(sent)


def _open_at_robot(endpoint: RobotEndpoint, datagram: bytes) -> tuple[Header, Message]:
    header = _read(datagram)
    channel = endpoint.channels.get(header.sender)
    if channel is None:
        raise _Refused(header.sender, Cause.UNKNOWN_SENDER)
    if header.kind not in TO_ROBOT:
        raise _Refused(header.sender, Cause.UNEXPECTED_KIND)
    if header.connection == 0:
        if header.kind is not Kind.HELLO:
            raise _Refused(header.sender, Cause.OTHER_CONNECTION)
        if endpoint.last_connection == MAX_CONNECTION:
            raise _Refused(header.sender, Cause.CONNECTIONS_EXHAUSTED)
    else:
        if header.boot != endpoint.boot:
            raise _Refused(header.sender, Cause.OTHER_BOOT)
        if not max(channel.connection, 1) <= header.connection <= channel.assigned:
            raise _Refused(header.sender, Cause.OTHER_CONNECTION)
        if header.connection == channel.connection and not channel.window.accepts(header.sequence):
            raise _Refused(header.sender, Cause.REPEATED)
    return header, _open(channel.peer.key, header, datagram)


def _open_at_operator(endpoint: OperatorEndpoint, datagram: bytes) -> tuple[Header, Message]:
    header = _read(datagram)
    if header.sender != ROBOT:
        raise _Refused(header.sender, Cause.UNKNOWN_SENDER)
    if header.kind not in TO_OPERATOR:
        raise _Refused(ROBOT, Cause.UNEXPECTED_KIND)
    if header.kind is Kind.WELCOME:
        if not endpoint.is_greeting or header.connection == 0:
            raise _Refused(ROBOT, Cause.OTHER_CONNECTION)
        message = _open(endpoint.key, header, datagram, _challenge(endpoint))
        if not isinstance(message, Welcome) or (message.boot, message.connection) != (
            header.boot,
            header.connection,
        ):
            raise _Refused(ROBOT, Cause.MALFORMED)
        return header, message
    if header.connection == 0 or header.connection != endpoint.connection:
        raise _Refused(ROBOT, Cause.OTHER_CONNECTION)
    if header.boot != endpoint.boot:
        raise _Refused(ROBOT, Cause.OTHER_BOOT)
    if not endpoint.window.accepts(header.sequence):
        raise _Refused(ROBOT, Cause.REPEATED)
    return header, _open(endpoint.key, header, datagram)


def _read(datagram: bytes) -> Header:
    try:
        return read_header(datagram)
    except MalformedMessage:
        raise _Refused(-1, Cause.MALFORMED) from None


def _open(key: bytes, header: Header, datagram: bytes, challenge: int = 0) -> Message:
    try:
        return decode(header.kind, open_datagram(key, header, datagram, challenge))
    except Unauthentic:
        raise _Refused(header.sender, Cause.UNAUTHENTIC) from None
    except MalformedMessage:
        raise _Refused(header.sender, Cause.MALFORMED) from None


def _welcome(endpoint: RobotEndpoint, hello: Header) -> tuple[RobotEndpoint, bytes]:
    """Assign a connection to the sender of a hello, and return its welcome."""
    channel, number = endpoint.channels[hello.sender], endpoint.last_connection + 1
    payload = encode(Welcome(endpoint.boot, number, endpoint.max_budget, endpoint.max_jitter))
    header = Header(Kind.WELCOME, ROBOT, endpoint.boot, number, 0)
    datagram = seal_datagram(channel.peer.key, header, payload, challenge=hello.boot)
    endpoint = _with_channel(endpoint, replace(channel, assigned=number))
    return replace(endpoint, last_connection=number), datagram


def _with_channel(endpoint: RobotEndpoint, channel: Channel) -> RobotEndpoint:
    return replace(endpoint, channels={**endpoint.channels, channel.peer.number: channel})


def _challenge(endpoint: OperatorEndpoint) -> int:
    digest = hashlib.sha256(endpoint.seed + endpoint.challenges.to_bytes(8, "little")).digest()
    return int.from_bytes(digest[:8], "little")


def _require_kind(message: Message, kinds: Sequence[Kind]) -> Kind:
    kind = kind_of(message)
    if kind not in kinds:
        names = ", ".join(each.name for each in kinds)
        raise InvalidInput(
            f"message is a {kind.name}, which this side does not send, expected one of {names}"
        )
    return kind


def _require_sequence(sequence: int) -> None:
    """Refuse the last sequence: the next one would be zero, under a key that sealed it before."""
    if sequence >= MAX_SEQUENCE:
        raise SequenceExhausted(f"sequence is {sequence}, expected less; connect again")
