"""Authenticated channel: bounded state, last numbers, invalid arguments."""

from dataclasses import replace

import pytest
from teleop_endpoints import (
    KEYS,
    PEERS,
    connect,
    new_operator,
    new_robot,
    refused,
)
from teleop_messages import EXAMPLES

from pilotfish.errors import InvalidInput
from pilotfish.teleop.channels import Peer, operator_endpoint, robot_endpoint
from pilotfish.teleop.codec import Kind
from pilotfish.teleop.datagram_checks import LAST_CAUSES, Cause
from pilotfish.teleop.endpoints import (
    receive_at_robot,
    send_from_operator,
    send_from_robot,
)
from pilotfish.teleop.errors import MalformedMessage, SequenceExhausted
from pilotfish.teleop.messages import Hello, OutgoingMessage, Stop

COMMAND, REPORT = EXAMPLES[Kind.COMMAND], EXAMPLES[Kind.REPORT]


def test_hundred_connections_leave_state_of_fixed_size() -> None:
    robot, operators = new_robot(), []
    for n in range(100):
        robot, operator = connect(robot, new_operator(1 + n % 3, seed=n.to_bytes(16, "little")))
        operators.append(operator)
    assert [operator.connection for operator in operators] == list(range(1, 101))
    assert len(robot.channels) == 3
    for operator in operators:
        _, (stop,) = send_from_operator(operator, [Stop(1)])
        if operator.connection > 97:
            robot, received, _ = receive_at_robot(robot, [stop])
            assert len(received) == 1
        else:
            robot = refused(robot, stop, Cause.OTHER_CONNECTION)
    assert len(robot.audit.last) == LAST_CAUSES


def test_refused_flood_leaves_audit_of_fixed_size() -> None:
    robot, received, replies = receive_at_robot(new_robot(), [b"x" * 40] * 5000)
    assert (received, replies) == ((), ())
    assert robot.audit.count(Cause.MALFORMED) == 5000
    assert len(robot.audit.last) == LAST_CAUSES


def test_last_sequence_is_not_sent() -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator = replace(operator, sequence=2**32 - 2)
    operator, _ = send_from_operator(operator, [COMMAND])
    with pytest.raises(SequenceExhausted, match="sequence is 4294967295"):
        send_from_operator(operator, [COMMAND])
    channel = replace(robot.channels[1], sequence=2**32 - 1)
    robot = replace(robot, channels={**robot.channels, 1: channel})
    with pytest.raises(SequenceExhausted, match="sequence is 4294967295"):
        send_from_robot(robot, [OutgoingMessage(1, REPORT)])
    with pytest.raises(SequenceExhausted, match="sequence is 4294967295"):
        send_from_operator(replace(new_operator(), hellos=2**32 - 1), ())


def test_last_connection_is_not_exceeded() -> None:
    _, (hello,) = send_from_operator(new_operator(), ())
    refused(replace(new_robot(), last_connection=2**32 - 1), hello, Cause.CONNECTIONS_EXHAUSTED)


def test_representation_hides_keys_and_seeds() -> None:
    robot, operator = connect(new_robot(), new_operator())
    for text in (repr(PEERS[0]), repr(robot), repr(operator)):
        assert "aaaa" not in text
        assert "ssss" not in text


def test_invalid_peers_and_messages_raise() -> None:
    robot, operator = connect(new_robot(), new_operator())
    calls = [
        (lambda: robot_endpoint([PEERS[0], PEERS[0]], 1), "peers have a number in common"),
        (lambda: robot_endpoint([PEERS[0], Peer(5, KEYS[1], True)], 1), "peers have a key in common"),
        (lambda: robot_endpoint([Peer(0, KEYS[1], True)], 1), "number of a peer is 0"),
        (lambda: robot_endpoint([Peer(65536, KEYS[1], True)], 1), "number of a peer is 65536"),
        (lambda: robot_endpoint([Peer(1, b"short", True)], 1), "key has 5 bytes"),
        (lambda: robot_endpoint(PEERS, 2**64), "boot is"),
        (lambda: operator_endpoint(1, KEYS[1], b"short"), "seed has 5 bytes"),
        (lambda: send_from_robot(robot, [OutgoingMessage(9, REPORT)]), "receiver is 9"),
        (lambda: send_from_robot(robot, [OutgoingMessage(1, Hello())]), "message is a HELLO"),
        (lambda: send_from_operator(operator, [REPORT]), "message is a REPORT"),
    ]
    for call, match in calls:
        with pytest.raises(InvalidInput, match=match):
            call()
    with pytest.raises(MalformedMessage, match="max_budget is -1"):
        robot_endpoint(PEERS, 1, max_budget=-1.0)
