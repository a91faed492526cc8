"""Sealed datagrams: a header in clear text, the encrypted message, and an authentication tag.

A datagram is header (20 bytes), ChaCha20 ciphertext and Poly1305 tag (16 bytes), which covers the header too.
A nonce must never repeat under one key with another message. Keys are therefore derived from the key of the
peer by HMAC-SHA256 for each purpose, start of the robot and connection, and the sequence is the nonce:

    hello     challenge of the operator                      sequence of its hellos
    welcome   boot and connection, with the challenge        one datagram per key
    operator  boot and connection                            sequence of the operator
    robot     boot and connection                            sequence of the robot

The robot never gives a number of a connection twice, and draws another boot at each start.
"""

import hmac
from dataclasses import dataclass
from functools import lru_cache
from struct import Struct, error
from typing import Any

from pilotfish.errors import InvalidInput
from pilotfish.teleop.codec import Kind, payload_size
from pilotfish.teleop.errors import MalformedMessage, Unauthentic
from pilotfish.teleop.messages import ROBOT, VERSION

KEY_SIZE, TAG_SIZE = 32, 16  # bytes
MAX_SEQUENCE = 2**32 - 1  # never sent
_HEADER = Struct("<BBHQII")
_CONTEXT = Struct("<8sQIQ")
HEADER_SIZE = _HEADER.size
MAX_CACHED_KEYS = 256


@dataclass(frozen=True, slots=True)
class Header:
    """First bytes of a datagram, after the version.

    Attributes:
        kind: Kind of the message.
        sender: Number of the peer; 0 is the robot.
        boot: Number of this start of the robot; in a first hello the challenge.
        connection: Number of the connection; 0 in a first hello.
        sequence: Increases with every datagram of a sender and connection.
    """

    kind: Kind
    sender: int
    boot: int
    connection: int
    sequence: int


def datagram_size(kind: int) -> int:
    """Return the number of bytes of a datagram of one kind.

    Args:
        kind: Number of the kind.
    """
    return HEADER_SIZE + payload_size(kind) + TAG_SIZE


def read_header(datagram: bytes) -> Header:
    """Return the header of a datagram, which is not authentic before `open_datagram` accepted it.

    Args:
        datagram: All bytes that arrived.

    Raises:
        MalformedMessage: If the length, the version or the kind is wrong.
    """
    if len(datagram) < HEADER_SIZE + TAG_SIZE:
        raise MalformedMessage(
            f"datagram has {len(datagram)} bytes, expected at least {HEADER_SIZE + TAG_SIZE}"
        )
    version, kind, *rest = _HEADER.unpack_from(datagram)
    if version != VERSION:
        raise MalformedMessage(f"version is {version}, expected {VERSION}; install one release at both sites")
    if len(datagram) != (size := datagram_size(kind)):
        raise MalformedMessage(f"datagram of kind {kind} has {len(datagram)} bytes, expected {size}")
    return Header(Kind(kind), *rest)


def seal_datagram(key: bytes, header: Header, payload: bytes, challenge: int = 0) -> bytes:
    """Return the datagram of a message.

    Args:
        key: Key of the peer, 32 bytes.
        header: Header; never the same one with another message.
        payload: Bytes of the message.
        challenge: Challenge that a welcome answers; 0 in other messages.

    Raises:
        InvalidInput: If a number of the header does not fit, or `cryptography` is not installed.
    """
    try:
        head = _HEADER.pack(
            VERSION, header.kind, header.sender, header.boot, header.connection, header.sequence
        )
        cipher = _cipher(key, *_purpose(header), challenge)
    except error as problem:
        raise InvalidInput(f"header is {header}, expected whole numbers that fit: {problem}") from problem
    sealed: bytes = cipher.encrypt(_nonce(header), payload, head)
    return head + sealed


def open_datagram(key: bytes, header: Header, datagram: bytes, challenge: int = 0) -> bytes:
    """Return the bytes of the message in a datagram.

    Args:
        key: Key of the peer, 32 bytes.
        header: Header, from `read_header`.
        datagram: All bytes.
        challenge: Challenge that a welcome answers; 0 in other messages.

    Raises:
        Unauthentic: If the datagram was not sealed with this key, or was changed.
        InvalidInput: If `cryptography` is not installed.
    """
    cipher = _cipher(key, *_purpose(header), challenge)
    from cryptography.exceptions import InvalidTag

    try:
        payload: bytes = cipher.decrypt(_nonce(header), datagram[HEADER_SIZE:], datagram[:HEADER_SIZE])
    except InvalidTag:
        raise Unauthentic(f"datagram of sender {header.sender} was not sealed with its key") from None
    return payload


def require_cryptography() -> None:
    """Refuse to go further without the package `cryptography`.

    Raises:
        InvalidInput: If it is not installed.
    """
    try:
        import cryptography  # noqa: F401 # whether it can be imported
    except ImportError as problem:
        raise InvalidInput(
            "messages are sealed by the package cryptography, which is missing: pip install '.[link]' in the "
            "clone"
        ) from problem


def _purpose(header: Header) -> tuple[bytes, int, int]:
    """Return purpose, boot and connection for the key."""
    if header.kind is Kind.WELCOME:
        name = b"welcome"
    elif header.sender == ROBOT:
        name = b"robot"
    else:
        name = b"operator" if header.connection else b"hello"
    return name, header.boot, header.connection


def _nonce(header: Header) -> bytes:
    return bytes(8) + header.sequence.to_bytes(4, "little")


@lru_cache(maxsize=MAX_CACHED_KEYS)
def _cipher(key: bytes, purpose: bytes, boot: int, connection: int, challenge: int) -> Any:
    """Return the cipher for one purpose and connection of a peer."""
    require_cryptography()
    from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

    context = _CONTEXT.pack(purpose, boot, connection, challenge)
    return ChaCha20Poly1305(hmac.digest(key, b"pilotfish teleop 1" + context, "sha256"))
