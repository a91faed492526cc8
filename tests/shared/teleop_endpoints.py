"""Endpoints of one robot and three peers, and their connection without faults."""

from dataclasses import replace

from pilotfish.teleop.channels import OperatorEndpoint, Peer, RobotEndpoint, operator_endpoint, robot_endpoint
from pilotfish.teleop.datagram_checks import EMPTY_AUDIT, Cause
from pilotfish.teleop.endpoints import (
    receive_at_operator,
    receive_at_robot,
    send_from_operator,
)
from pilotfish.teleop.messages import Welcome

KEYS = {1: b"a" * 32, 2: b"b" * 32, 3: b"c" * 32}
PEERS = [Peer(1, KEYS[1], True), Peer(2, KEYS[2], True), Peer(3, KEYS[3], False)]


def new_robot(boot: int = 11) -> RobotEndpoint:
    return robot_endpoint(PEERS, boot)


def new_operator(number: int = 1, seed: bytes = b"s" * 32) -> OperatorEndpoint:
    return operator_endpoint(number, KEYS[number], seed)


def connect(robot: RobotEndpoint, operator: OperatorEndpoint) -> tuple[RobotEndpoint, OperatorEndpoint]:
    """Exchange hello, welcome and confirmation without faults."""
    operator, (hello,) = send_from_operator(operator, ())
    robot, received, ((number, welcome),) = receive_at_robot(robot, [hello])
    assert (received, number) == ((), operator.number)
    operator, received = receive_at_operator(operator, [welcome])
    assert isinstance(received[0].message, Welcome)
    operator, (confirmation,) = send_from_operator(operator, ())
    robot, received, replies = receive_at_robot(robot, [confirmation])
    assert (received, replies) == ((), ())
    return robot, operator


def without_audit(endpoint: RobotEndpoint | OperatorEndpoint) -> RobotEndpoint | OperatorEndpoint:
    return replace(endpoint, audit=EMPTY_AUDIT)


def refused(robot: RobotEndpoint, datagram: bytes, cause: Cause) -> RobotEndpoint:
    """Require that a datagram changes nothing but one counter, and return the state."""
    after, received, replies = receive_at_robot(robot, [datagram])
    assert (received, replies) == ((), ())
    assert without_audit(after) == without_audit(robot)
    assert after.audit.count(cause) == robot.audit.count(cause) + 1
    assert sum(after.audit.counts) == sum(robot.audit.counts) + 1
    assert after.audit.last[-1][1] is cause
    return after


def refused_at_operator(operator: OperatorEndpoint, datagram: bytes, cause: Cause) -> OperatorEndpoint:
    after, received = receive_at_operator(operator, [datagram])
    assert received == ()
    assert replace(without_audit(after), silent_calls=0) == replace(without_audit(operator), silent_calls=0)
    assert after.audit.count(cause) == operator.audit.count(cause) + 1
    return after
