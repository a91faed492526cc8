"""Sealed datagrams: sizes, published vectors, and refusal of every change."""

import hashlib
import hmac
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from hypothesis import given
from hypothesis import strategies as st
from teleop_messages import EXAMPLES

from pilotfish.errors import InvalidInput
from pilotfish.teleop import seal
from pilotfish.teleop.codec import Kind, encode
from pilotfish.teleop.errors import MalformedMessage, Unauthentic
from pilotfish.teleop.seal import Header, datagram_size, open_datagram, read_header, seal_datagram

KEY = bytes(range(32))
HEADER = Header(Kind.COMMAND, 3, 0x0102030405060708, 5, 77)
PAYLOAD = encode(EXAMPLES[Kind.COMMAND])
DATAGRAM = seal_datagram(KEY, HEADER, PAYLOAD)


def test_command_datagram_has_at_most_110_bytes() -> None:
    assert len(DATAGRAM) == datagram_size(Kind.COMMAND) == 109
    assert len(DATAGRAM) <= 110


@pytest.mark.parametrize("kind", Kind)
def test_datagram_fits_ethernet_and_has_size_of_its_kind(kind: Kind) -> None:
    datagram = seal_datagram(KEY, replace(HEADER, kind=kind), encode(EXAMPLES[kind]))
    assert len(datagram) == datagram_size(kind) <= 1200


def test_seal_equals_key_derivation_and_cipher_written_out() -> None:
    head = bytes([1, 3]) + struct.pack("<HQII", 3, 0x0102030405060708, 5, 77)
    context = b"operator" + struct.pack("<QIQ", 0x0102030405060708, 5, 0)
    key = hmac.new(KEY, b"pilotfish teleop 1" + context, hashlib.sha256).digest()
    nonce = bytes(8) + struct.pack("<I", 77)
    assert ChaCha20Poly1305(key).encrypt(nonce, PAYLOAD, head) == DATAGRAM[20:]
    assert DATAGRAM[:20] == head


def test_open_sealed_datagram_returns_payload() -> None:
    assert read_header(DATAGRAM) == HEADER
    assert open_datagram(KEY, HEADER, DATAGRAM) == PAYLOAD


@given(st.sets(st.integers(0, 8 * len(DATAGRAM) - 1), min_size=1, max_size=4))
def test_open_datagram_with_any_bits_changed_raises(positions: set[int]) -> None:
    changed = bytearray(DATAGRAM)
    for position in positions:
        changed[position // 8] ^= 1 << position % 8
    with pytest.raises((MalformedMessage, Unauthentic)):
        open_datagram(KEY, read_header(bytes(changed)), bytes(changed))


def test_open_datagram_every_single_bit_changed_raises() -> None:
    for position in range(8 * len(DATAGRAM)):
        changed = bytearray(DATAGRAM)
        changed[position // 8] ^= 1 << position % 8
        with pytest.raises((MalformedMessage, Unauthentic)):
            open_datagram(KEY, read_header(bytes(changed)), bytes(changed))


def test_open_datagram_other_key_or_challenge_raises() -> None:
    for key, challenge in ((bytes(32), 0), (KEY, 1)):
        with pytest.raises(Unauthentic, match="sender 3 was not sealed with its key"):
            open_datagram(key, HEADER, DATAGRAM, challenge)


def test_keys_of_all_purposes_differ() -> None:
    """A datagram sent back to its sender, or in another phase, has another key."""
    headers = [replace(HEADER, sender=sender, kind=kind) for sender in (0, 3) for kind in Kind]
    headers += [replace(HEADER, connection=number) for number in (0, 6)] + [replace(HEADER, boot=9)]
    purposes = {seal._purpose(header) for header in headers}
    assert len(purposes) == 6  # welcome, robot, operator, hello, other connection, other boot


@pytest.mark.parametrize("length", [0, 1, 19, 20, 35, 108, 110, 2000])
def test_read_header_wrong_length_raises(length: int) -> None:
    with pytest.raises(MalformedMessage, match=f"has {length} bytes, expected"):
        read_header((DATAGRAM * 20)[:length])


@pytest.mark.parametrize(
    ("position", "match"), [(0, "version is 9, expected 1"), (1, "has 109 bytes|kind is")]
)
def test_read_header_other_version_or_kind_raises(position: int, match: str) -> None:
    changed = bytearray(DATAGRAM)
    changed[position] = 9
    with pytest.raises(MalformedMessage, match=match):
        read_header(bytes(changed))


def test_read_header_unknown_kind_raises() -> None:
    with pytest.raises(MalformedMessage, match="kind is 200, expected 1 to 9"):
        read_header(bytes([1, 200]) + DATAGRAM[2:])


@pytest.mark.parametrize("change", [{"sequence": 2**32}, {"sender": -1}, {"boot": 2**64}])
def test_seal_datagram_number_that_does_not_fit_raises(change: dict[str, int]) -> None:
    with pytest.raises(InvalidInput, match="expected whole numbers that fit"):
        seal_datagram(KEY, replace(HEADER, **change), PAYLOAD)


def test_cached_keys_are_bounded() -> None:
    for connection in range(2 * seal.MAX_CACHED_KEYS):
        seal_datagram(KEY, replace(HEADER, connection=connection), PAYLOAD)
    assert seal._cipher.cache_info().currsize <= seal.MAX_CACHED_KEYS


WITHOUT = """
import sys
sys.meta_path[:] = [each for each in sys.meta_path if "ScikitBuild" not in type(each).__name__]
sys.path.insert(0, {source!r})
sys.modules["cryptography"] = None
import pilotfish.teleop
from pilotfish.errors import InvalidInput
from pilotfish.teleop.seal import Header, seal_datagram
from pilotfish.teleop.codec import Kind
try:
    seal_datagram(bytes(32), Header(Kind.HELLO, 1, 2, 0, 0), b"")
except InvalidInput as error:
    assert "pip install '.[link]' in the clone" in str(error), error
else:
    raise AssertionError("sealed without cryptography")
"""


def test_seal_without_cryptography_names_the_extra() -> None:
    """`import pilotfish.teleop` needs no extra."""
    source = str(Path(seal.__file__).parents[2])
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", WITHOUT.format(source=source)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
