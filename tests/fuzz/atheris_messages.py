"""Fuzz the decoder and the robot's endpoint with atheris, which follows the coverage of the code.

Not collected by pytest, and atheris is not a requirement:
    python tests/fuzz/atheris_messages.py -max_total_time=600
The first byte of an input chooses the kind, the second what is done; the others are a message or a datagram.
"""

import sys
from pathlib import Path

import atheris

sys.path.insert(0, str(Path(__file__).parents[1] / "shared"))

with atheris.instrument_imports(include=["pilotfish.teleop"]):
    from pilotfish.teleop import Kind, MalformedMessage, decode, encode, receive_at_robot
    from pilotfish.teleop.codec import payload_size
    from pilotfish.teleop.seal import Header, seal_datagram

from teleop_endpoints import KEYS, connect, new_operator, new_robot, without_audit

ROBOT_ENDPOINT, _ = connect(new_robot(), new_operator())
KINDS = list(Kind)


def test_one_input(data: bytes) -> None:
    """Raise if the decoder raises another error, or a refused datagram changes the state."""
    if len(data) < 2:
        return
    kind, what, rest = KINDS[data[0] % len(KINDS)], data[1] % 4, data[2:]
    if what:  # the right length
        size = payload_size(kind)
        rest = rest[:size].ljust(size, b"\0")
    try:
        message = decode(kind, rest)
        if decode(kind, encode(message)) != message:
            raise AssertionError(f"{kind.name} changes when it is encoded again")
    except MalformedMessage:
        pass
    datagram = rest if what < 2 else seal_datagram(KEYS[1], Header(kind, 1, 11, 1, 9), rest)
    after, received, replies = receive_at_robot(ROBOT_ENDPOINT, [datagram])
    is_refused = after.audit != ROBOT_ENDPOINT.audit
    if is_refused and (received or replies or without_audit(after) != without_audit(ROBOT_ENDPOINT)):
        raise AssertionError("a refused datagram changed the state")


if __name__ == "__main__":
    atheris.Setup(sys.argv, test_one_input)
    atheris.Fuzz()
