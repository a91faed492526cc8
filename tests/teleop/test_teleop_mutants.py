"""Hostile datagrams of every kind; PILOTFISH_FUZZ is the number of mutants.

Half have the right length and seal: their message was changed before it was sealed.
"""

import os
from dataclasses import replace
from random import Random

import pytest
from teleop_endpoints import KEYS, connect, new_operator, new_robot, without_audit
from teleop_messages import EXAMPLES, mutate

from pilotfish.teleop import Kind, MalformedMessage, decode, encode, receive_at_operator, receive_at_robot
from pilotfish.teleop.channels import OperatorEndpoint, RobotEndpoint
from pilotfish.teleop.endpoints import TO_OPERATOR, TO_ROBOT
from pilotfish.teleop.messages import ROBOT, Hello
from pilotfish.teleop.seal import Header, seal_datagram

MUTANTS = int(os.environ.get("PILOTFISH_FUZZ", "20000"))
PAYLOADS = {kind: encode(EXAMPLES[kind]) for kind in Kind}


def require_canonical_or_malformed(kind: Kind, payload: bytes) -> bool:
    """Return whether bytes are accepted; the message then stays the same after encoding it."""
    try:
        message = decode(kind, payload)
    except MalformedMessage:
        return False
    assert decode(kind, encode(message)) == message
    return True


def sealed_mutant(kind: Kind, rng: Random, sequence: int) -> tuple[bytes, bytes]:
    """Return a mutant of a message, and a datagram; half of them are changed after they were sealed."""
    payload = mutate(PAYLOADS[kind], rng)
    sender = 1 if kind in TO_ROBOT else ROBOT
    datagram = seal_datagram(KEYS[1], Header(kind, sender, 11, 1, sequence), payload)
    if rng.random() < 0.5:
        return payload, datagram
    changed = mutate(datagram, rng)
    return payload, changed if rng.random() < 0.7 else changed[: rng.randrange(len(changed) + 1)]


def receive(
    robot: RobotEndpoint, operator: OperatorEndpoint, datagram: bytes
) -> tuple[RobotEndpoint, OperatorEndpoint, int]:
    """Give both sites a datagram; one that was refused changes the audit only."""
    after, received, replies = receive_at_robot(robot, [datagram])
    if after.audit != robot.audit:
        assert (received, replies) == ((), ())
        assert without_audit(after) == without_audit(robot)
    operator_after, heard_by_operator = receive_at_operator(operator, [datagram])
    operator_after = replace(operator_after, silent_calls=0)
    if operator_after.audit != operator.audit:
        assert heard_by_operator == ()
        assert without_audit(operator_after) == without_audit(operator)
    return after, operator_after, len(received) + len(replies) + len(heard_by_operator)


@pytest.mark.slow  # PILOTFISH_FUZZ=1000000 takes minutes
@pytest.mark.usefixtures("unchecked")
def test_mutants_of_every_kind_are_sound_or_refused() -> None:
    """Both sites are connected; each mutant has a new sequence."""
    rng = Random(0)
    robot, operator = connect(new_robot(), new_operator())
    operator = replace(operator, is_confirmed=True, silent_calls=0)
    accepted = received = 0
    for number in range(MUTANTS):
        kind = rng.choice(list(Kind))
        payload, datagram = sealed_mutant(kind, rng, number + 1)
        accepted += require_canonical_or_malformed(kind, payload)
        robot, operator, count = receive(robot, operator, datagram)
        received += count
    assert 0.1 * MUTANTS < accepted < 0.9 * MUTANTS
    assert 0.05 * MUTANTS < received < 0.5 * MUTANTS
    assert sum(robot.audit.counts) + sum(operator.audit.counts) > MUTANTS
    assert (len(robot.channels), len(robot.audit.last)) == (3, 16)
    assert set(TO_ROBOT) | set(TO_OPERATOR) == set(Kind)
    assert encode(Hello()) == b""
