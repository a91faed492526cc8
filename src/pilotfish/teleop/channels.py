"""States of the authenticated channel at both sites; `endpoints` has their steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pilotfish.errors import InvalidInput
from pilotfish.teleop.codec import encode
from pilotfish.teleop.datagram_checks import EMPTY_AUDIT, EMPTY_WINDOW, Audit, ReceiveWindow
from pilotfish.teleop.messages import Welcome
from pilotfish.teleop.seal import KEY_SIZE, require_cryptography
from pilotfish.validation import shorten_repr

MIN_SEED = 16  # bytes


@dataclass(frozen=True, slots=True)
class Peer:
    """Operator or observer that the robot knows.

    Attributes:
        number: Number, 1 to 65535.
        key: Secret key of 32 random bytes, which this peer and the robot share.
        can_operate: Whether it may take control; otherwise it may observe and stop.
    """

    number: int
    key: bytes = field(repr=False)
    can_operate: bool


@dataclass(frozen=True, slots=True)
class Channel:
    """What the robot knows of one peer.

    Attributes:
        peer: Peer.
        connection: Connection in use; 0 for none.
        assigned: Connection that was assigned last; 0 for none.
        window: Sequences that arrived in the connection.
        sequence: Sequence of the next datagram to the peer.
    """

    peer: Peer
    connection: int = 0
    assigned: int = 0
    window: ReceiveWindow = EMPTY_WINDOW
    sequence: int = 0


@shorten_repr
@dataclass(frozen=True, slots=True)
class RobotEndpoint:
    """Channels of the robot; `robot_endpoint` creates it.

    Attributes:
        boot: Random number of this start of the robot.
        max_budget: Longest round-trip budget, for the welcome [s].
        max_jitter: Largest jitter, for the welcome [s].
        channels: Channel of each peer, by its number.
        last_connection: Connection that was assigned last, to any peer.
        audit: Refused datagrams.
    """

    boot: int
    max_budget: float
    max_jitter: float
    channels: Mapping[int, Channel]
    last_connection: int = 0
    audit: Audit = EMPTY_AUDIT


@shorten_repr
@dataclass(frozen=True, slots=True)
class OperatorEndpoint:
    """Channel of an operator; `operator_endpoint` creates it.

    Attributes:
        number: Number of this peer.
        key: Key that it shares with the robot.
        seed: Random bytes from which the challenges follow.
        boot: Number of the robot's start, from the welcome.
        connection: Connection in use; 0 for none.
        challenges: Number of challenges that were drawn.
        is_greeting: Whether a hello waits for its welcome.
        is_confirmed: Whether the robot uses the connection, too.
        hellos: Number of hellos that were sent before a welcome.
        send_calls: Calls of send since the current challenge or connection.
        silent_calls: Calls of receive since the last valid datagram.
        window: Sequences that arrived in the connection.
        sequence: Sequence of the next datagram.
        audit: Refused datagrams.
    """

    number: int
    key: bytes = field(repr=False)
    seed: bytes = field(repr=False)
    boot: int = 0
    connection: int = 0
    challenges: int = 1
    is_greeting: bool = True
    is_confirmed: bool = False
    hellos: int = 0
    send_calls: int = 0
    silent_calls: int = 0
    window: ReceiveWindow = EMPTY_WINDOW
    sequence: int = 0
    audit: Audit = EMPTY_AUDIT


def robot_endpoint(
    peers: Sequence[Peer], boot: int, max_budget: float = 3.0, max_jitter: float = 0.5
) -> RobotEndpoint:
    """Create the robot's channels, none of which is connected.

    Args:
        peers: Operators and observers, with different numbers and keys.
        boot: Random number of 64 bits, another one at each start.
        max_budget: Longest round-trip budget [s].
        max_jitter: Largest jitter [s].

    Raises:
        InvalidInput: If a number, key or limit cannot be used, or `cryptography` is not installed.
    """
    require_cryptography()
    for peer in peers:
        _require_peer(peer.number, peer.key)
    for name, values in (("number", {p.number for p in peers}), ("key", {p.key for p in peers})):
        if len(values) != len(peers):
            raise InvalidInput(f"peers have a {name} in common, expected a different {name} for each")
    if not 0 <= boot < 2**64:
        raise InvalidInput(f"boot is {boot}, expected a random number of 64 bits; secrets.randbits(64)")
    encode(Welcome(boot, 1, max_budget, max_jitter))
    return RobotEndpoint(boot, max_budget, max_jitter, {peer.number: Channel(peer) for peer in peers})


def operator_endpoint(number: int, key: bytes, seed: bytes) -> OperatorEndpoint:
    """Create the channel of an operator or observer, not yet connected.

    Args:
        number: Number of this peer, 1 to 65535.
        key: Key that it shares with the robot, 32 bytes.
        seed: At least 16 random bytes, others at each start.

    Raises:
        InvalidInput: If a value cannot be used, or `cryptography` is not installed.
    """
    require_cryptography()
    _require_peer(number, key)
    if len(seed) < MIN_SEED:
        raise InvalidInput(
            f"seed has {len(seed)} bytes, expected at least {MIN_SEED}; secrets.token_bytes(32)"
        )
    return OperatorEndpoint(number, key, seed)


def _require_peer(number: int, key: bytes) -> None:
    if not 1 <= number <= 0xFFFF:
        raise InvalidInput(f"number of a peer is {number}, expected 1 to 65535")
    if len(key) != KEY_SIZE:
        raise InvalidInput(f"key has {len(key)} bytes, expected {KEY_SIZE}; secrets.token_bytes(32)")
