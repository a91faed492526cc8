"""Authenticated channel: handshake, repeated and reordered datagrams, restarts, bounded state."""

import hashlib
from dataclasses import replace
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st
from teleop_endpoints import (
    KEYS,
    PEERS,
    connect,
    new_operator,
    new_robot,
    refused,
    refused_at_operator,
    without_audit,
)
from teleop_messages import EXAMPLES

from pilotfish.teleop.channels import Peer, operator_endpoint, robot_endpoint
from pilotfish.teleop.codec import Kind, encode
from pilotfish.teleop.datagram_checks import WINDOW, Cause, ReceiveWindow
from pilotfish.teleop.endpoints import (
    HELLO_STEPS,
    SILENT_STEPS,
    receive_at_operator,
    receive_at_robot,
    send_from_operator,
    send_from_robot,
)
from pilotfish.teleop.messages import ROBOT, OutgoingMessage, ReceivedMessage, Stop, Welcome
from pilotfish.teleop.seal import Header, read_header, seal_datagram

COMMAND, REPORT, STATUS = EXAMPLES[Kind.COMMAND], EXAMPLES[Kind.REPORT], EXAMPLES[Kind.SKILL_STATUS]


def test_connected_sites_hear_each_other() -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator, datagrams = send_from_operator(operator, [COMMAND, Stop(3)])
    robot, received, replies = receive_at_robot(robot, datagrams)
    assert [each.sender for each in received] == [1, 1]
    assert encode(received[0].message) == encode(COMMAND)
    assert (received[1].message, replies) == (Stop(3), ())
    robot, sent = send_from_robot(
        robot, [OutgoingMessage(1, REPORT), OutgoingMessage(1, STATUS), OutgoingMessage(2, REPORT)]
    )
    assert [number for number, _ in sent] == [1, 1]  # peer 2 has no connection
    operator, received = receive_at_operator(operator, [datagram for _, datagram in sent])
    assert [encode(each.message) for each in received] == [encode(REPORT), encode(STATUS)]
    assert {each.sender for each in received} == {ROBOT}


def test_welcome_tells_boot_connection_and_limits() -> None:
    robot = robot_endpoint(PEERS, 2**64 - 1, max_budget=2.0, max_jitter=0.25)
    operator, (hello,) = send_from_operator(new_operator(), ())
    robot, _, ((_, welcome),) = receive_at_robot(robot, [hello])
    _, received = receive_at_operator(operator, [welcome])
    assert received == (ReceivedMessage(ROBOT, Welcome(2**64 - 1, 1, 2.0, 0.25)),)


def test_hello_challenge_is_hash_of_seed_and_counter() -> None:
    _, (hello,) = send_from_operator(new_operator(seed=b"x" * 16), ())
    digest = hashlib.sha256(b"x" * 16 + (1).to_bytes(8, "little")).digest()
    assert read_header(hello) == Header(Kind.HELLO, 1, int.from_bytes(digest[:8], "little"), 0, 0)


def test_operator_without_connection_sends_hellos_at_intervals_only() -> None:
    operator, sent = new_operator(), []
    for _ in range(3 * HELLO_STEPS):
        operator, datagrams = send_from_operator(operator, [COMMAND])
        sent.append([read_header(datagram) for datagram in datagrams])
    assert [len(each) for each in sent] == [1, *[0] * (HELLO_STEPS - 1)] * 3
    hellos = [header for each in sent for header in each]
    assert [(header.kind, header.sequence) for header in hellos] == [(Kind.HELLO, n) for n in range(3)]
    assert len({header.boot for header in hellos}) == 1


def test_operator_confirms_connection_until_robot_uses_it() -> None:
    """The first confirmation is lost; an observer has nothing to say."""
    robot, operator = new_robot(), new_operator(3)
    operator, (hello,) = send_from_operator(operator, ())
    robot, _, ((_, welcome),) = receive_at_robot(robot, [hello])
    operator, _ = receive_at_operator(operator, [welcome])
    counts = []
    for _ in range(HELLO_STEPS + 1):
        operator, datagrams = send_from_operator(operator, ())
        counts.append(len(datagrams))
    assert counts == [1, *[0] * (HELLO_STEPS - 1), 1]
    robot, _, _ = receive_at_robot(robot, datagrams)
    robot, ((_, report),) = send_from_robot(robot, [OutgoingMessage(3, REPORT)])
    operator, _ = receive_at_operator(operator, [report])
    assert operator.is_confirmed
    for _ in range(2 * HELLO_STEPS):
        operator, datagrams = send_from_operator(operator, ())
        assert datagrams == ()


def test_repeated_hello_costs_one_welcome_and_changes_nothing_else() -> None:
    operator, (hello,) = send_from_operator(new_operator(), ())
    robot, operator = connect(new_robot(), new_operator())
    before = robot
    for n in range(100):
        robot, received, replies = receive_at_robot(robot, [hello])
        assert received == ()
        assert len(replies) == 1
        refused_at_operator(operator, replies[0][1], Cause.OTHER_CONNECTION)
        assert robot.last_connection == before.last_connection + n + 1
    used = {number: replace(channel, assigned=0) for number, channel in robot.channels.items()}
    assert used == {number: replace(channel, assigned=0) for number, channel in before.channels.items()}
    _, datagrams = send_from_operator(operator, [COMMAND])
    assert len(receive_at_robot(robot, datagrams)[1]) == 1


def test_welcomes_of_one_hello_at_two_starts_have_different_keys() -> None:
    """Under one key and nonce, the difference of both messages would be readable."""
    _, (hello,) = send_from_operator(new_operator(), ())
    (_, _, ((_, one),)), (_, _, ((_, other),)) = (receive_at_robot(new_robot(b), [hello]) for b in (11, 12))
    plain = [encode(Welcome(boot, 1, 3.0, 0.5)) for boot in (11, 12)]
    streams = [
        bytes(a ^ b for a, b in zip(text, datagram[20:-16], strict=True))
        for text, datagram in zip(plain, (one, other), strict=True)
    ]
    assert sum(a == b for a, b in zip(*streams, strict=True)) < 8


def test_welcome_of_another_challenge_or_repeated_is_refused() -> None:
    robot, operator = new_robot(), new_operator()
    _, (other_hello,) = send_from_operator(new_operator(seed=b"t" * 32), ())
    robot, _, ((_, other_welcome),) = receive_at_robot(robot, [other_hello])
    operator, (hello,) = send_from_operator(operator, ())
    operator = refused_at_operator(operator, other_welcome, Cause.UNAUTHENTIC)
    robot, _, ((_, welcome),) = receive_at_robot(robot, [hello])
    operator, _ = receive_at_operator(operator, [welcome])
    refused_at_operator(operator, welcome, Cause.OTHER_CONNECTION)


def test_every_datagram_repeated_is_refused() -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator, datagrams = send_from_operator(operator, [COMMAND, Stop(1), COMMAND])
    robot, received, _ = receive_at_robot(robot, [*datagrams, *datagrams])
    assert len(received) == 3
    assert robot.audit.count(Cause.REPEATED) == 3
    robot, sent = send_from_robot(robot, [OutgoingMessage(1, REPORT)] * 2)
    operator, received = receive_at_operator(operator, [datagram for _, datagram in sent * 3])
    assert len(received) == 2
    assert operator.audit.count(Cause.REPEATED) == 4


def test_stop_overtaken_by_whole_window_is_accepted_once() -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator, (too_old, stop) = send_from_operator(operator, [Stop(1), Stop(2)])
    operator, commands = send_from_operator(operator, [COMMAND] * (WINDOW - 1))
    robot, received, _ = receive_at_robot(robot, [*commands, stop])
    assert received[-1].message == Stop(2)
    robot = refused(robot, stop, Cause.REPEATED)
    refused(robot, too_old, Cause.REPEATED)


@given(st.lists(st.integers(0, 5000), max_size=60), st.integers(0, 2**32))
def test_window_accepts_what_a_set_of_sequences_accepts(sequences: list[int], seed: int) -> None:
    rng = Random(seed)
    near = [max(0, n + rng.choice([-WINDOW - 1, -WINDOW, -WINDOW + 1, -1, 0, 1])) for n in sequences]
    window, received = ReceiveWindow(), set()
    for sequence in [*sequences, *near]:
        highest = max(received, default=-1)
        expected = sequence > highest - WINDOW and sequence not in received
        assert window.accepts(sequence) == expected
        if expected:
            window = window.add(sequence)
            received.add(sequence)
        assert window.received < 1 << WINDOW


@given(st.randoms(use_true_random=False))
@settings(max_examples=30)
def test_reordered_and_repeated_datagrams_are_heard_once(rng: Random) -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator, datagrams = send_from_operator(operator, [Stop(n) for n in range(60)])
    arrivals = [each for each in datagrams for _ in range(rng.choice((0, 1, 2)))]
    rng.shuffle(arrivals)
    robot, received, _ = receive_at_robot(robot, arrivals)
    assert sorted(each.message.number for each in received) == [
        n for n, each in enumerate(datagrams) if each in arrivals
    ]


def test_datagram_with_any_bit_changed_changes_nothing() -> None:
    robot, operator = connect(new_robot(), new_operator())
    _, (datagram,) = send_from_operator(operator, [Stop(1)])
    for position in range(8 * len(datagram)):
        changed = bytearray(datagram)
        changed[position // 8] ^= 1 << position % 8
        after, received, replies = receive_at_robot(robot, [bytes(changed)])
        assert (received, replies) == ((), ())
        assert without_audit(after) == without_audit(robot)
        assert sum(after.audit.counts) == 1


def test_operator_restarted_gets_connection_and_old_one_is_refused() -> None:
    robot, old = connect(new_robot(), new_operator())
    old, (late,) = send_from_operator(old, [COMMAND])
    robot, operator = connect(robot, new_operator(seed=b"t" * 32))
    assert operator.connection == 2
    refused(robot, late, Cause.OTHER_CONNECTION)
    robot, ((_, report),) = send_from_robot(robot, [OutgoingMessage(1, REPORT)])
    refused_at_operator(old, report, Cause.OTHER_CONNECTION)


def test_old_connection_works_until_new_one_is_used() -> None:
    robot, old = connect(new_robot(), new_operator())
    operator, (hello,) = send_from_operator(new_operator(seed=b"t" * 32), ())
    robot, _, ((_, welcome),) = receive_at_robot(robot, [hello])
    old, (command,) = send_from_operator(old, [COMMAND])
    robot, received, _ = receive_at_robot(robot, [command])
    assert len(received) == 1
    operator, _ = receive_at_operator(operator, [welcome])
    operator, (first,) = send_from_operator(operator, [COMMAND])
    old, (late,) = send_from_operator(old, [COMMAND])
    robot, received, _ = receive_at_robot(robot, [first])
    assert len(received) == 1
    assert robot.channels[1].window == ReceiveWindow(0, 1)
    robot = refused(robot, late, Cause.OTHER_CONNECTION)
    refused(robot, first, Cause.REPEATED)


def test_robot_restarted_refuses_everything_of_before() -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator, (command,) = send_from_operator(operator, [COMMAND])
    robot, ((_, report),) = send_from_robot(robot, [OutgoingMessage(1, REPORT)])
    restarted, second = connect(new_robot(boot=12), new_operator(seed=b"t" * 32))
    assert second.connection == operator.connection  # the same number at another start
    refused(restarted, command, Cause.OTHER_BOOT)
    refused_at_operator(second, report, Cause.OTHER_BOOT)


def test_other_robot_with_same_boot_and_connection_is_refused() -> None:
    """Two robots have different keys for one operator."""
    robot, operator = connect(new_robot(), new_operator())
    other = robot_endpoint([Peer(1, b"z" * 32, True)], 11)
    other, stranger = connect(other, operator_endpoint(1, b"z" * 32, b"s" * 32))
    _, (command,) = send_from_operator(stranger, [COMMAND])
    refused(robot, command, Cause.UNAUTHENTIC)
    _, ((_, report),) = send_from_robot(other, [OutgoingMessage(1, REPORT)])
    refused_at_operator(operator, report, Cause.UNAUTHENTIC)


def test_datagram_returned_to_its_sender_is_refused() -> None:
    robot, operator = connect(new_robot(), new_operator())
    operator, (command,) = send_from_operator(operator, [COMMAND])
    refused_at_operator(operator, command, Cause.UNKNOWN_SENDER)
    robot, ((_, report),) = send_from_robot(robot, [OutgoingMessage(1, REPORT)])
    refused(robot, report, Cause.UNKNOWN_SENDER)


def test_peer_with_key_of_another_number_is_refused() -> None:
    robot, _ = connect(new_robot(), new_operator())
    header = Header(Kind.STOP, 1, 11, 1, 50)
    refused(robot, seal_datagram(KEYS[2], header, encode(Stop(1))), Cause.UNAUTHENTIC)
    refused(robot, seal_datagram(KEYS[2], replace(header, sender=9), encode(Stop(1))), Cause.UNKNOWN_SENDER)


def test_connection_that_was_not_assigned_is_refused() -> None:
    robot, _ = connect(new_robot(), new_operator())
    for connection in (0, 2, 2**32 - 1):
        datagram = seal_datagram(KEYS[1], Header(Kind.STOP, 1, 11, connection, 50), encode(Stop(1)))
        refused(robot, datagram, Cause.OTHER_CONNECTION)


def test_kind_of_the_other_side_is_refused() -> None:
    robot, operator = connect(new_robot(), new_operator())
    report = seal_datagram(KEYS[1], Header(Kind.REPORT, 1, 11, 1, 50), encode(REPORT))
    refused(robot, report, Cause.UNEXPECTED_KIND)
    stop = seal_datagram(KEYS[1], Header(Kind.STOP, ROBOT, 11, 1, 50), encode(Stop(1)))
    refused_at_operator(operator, stop, Cause.UNEXPECTED_KIND)


def test_authentic_message_that_is_malformed_is_refused() -> None:
    robot, _ = connect(new_robot(), new_operator())
    payload = bytearray(encode(COMMAND))
    payload[70] = 9  # the mode
    datagram = seal_datagram(KEYS[1], Header(Kind.COMMAND, 1, 11, 1, 50), bytes(payload))
    refused(robot, datagram, Cause.MALFORMED)
    robot = refused(robot, b"", Cause.MALFORMED)
    assert robot.audit.last == ((-1, Cause.MALFORMED),)


def test_welcome_that_contradicts_its_header_is_refused() -> None:
    operator, (hello,) = send_from_operator(new_operator(), ())
    header, challenge = Header(Kind.WELCOME, ROBOT, 11, 1, 0), read_header(hello).boot
    for wrong in (Welcome(12, 1, 1.0, 1.0), Welcome(11, 2, 1.0, 1.0)):
        datagram = seal_datagram(KEYS[1], header, encode(wrong), challenge)
        refused_at_operator(operator, datagram, Cause.MALFORMED)


def test_silent_robot_is_greeted_again_while_connection_is_kept() -> None:
    robot, operator = connect(new_robot(), new_operator())
    robot, ((_, report),) = send_from_robot(robot, [OutgoingMessage(1, REPORT)])
    operator, _ = receive_at_operator(operator, [report])
    for _ in range(SILENT_STEPS - 1):
        operator, _ = receive_at_operator(operator, [b"invalid"])
    assert not operator.is_greeting
    operator, _ = receive_at_operator(operator, ())
    operator, (hello, command) = send_from_operator(operator, [COMMAND])
    assert read_header(hello).boot != read_header(send_from_operator(new_operator(), ())[1][0]).boot
    robot, received, ((_, welcome),) = receive_at_robot(robot, [hello, command])
    assert len(received) == 1
    operator, received = receive_at_operator(operator, [welcome])
    assert operator.connection == 2
    assert not operator.is_greeting


def test_welcome_later_than_silence_is_accepted() -> None:
    """The challenge stays the same until a welcome arrives, so a long round trip does not prevent it."""
    operator, (hello,) = send_from_operator(new_operator(), ())
    _, _, ((_, welcome),) = receive_at_robot(new_robot(), [hello])
    for _ in range(4 * SILENT_STEPS):
        operator, _ = receive_at_operator(operator, ())
        operator, _ = send_from_operator(operator, ())
    operator, received = receive_at_operator(operator, [welcome])
    assert len(received) == 1
    assert operator.connection == 1


def test_same_calls_give_same_bytes() -> None:
    runs = []
    for _ in range(2):
        robot, operator = connect(new_robot(), new_operator())
        runs.append(
            (
                send_from_operator(operator, [COMMAND])[1],
                send_from_robot(robot, [OutgoingMessage(1, REPORT)])[1],
            )
        )
    assert runs[0] == runs[1]
