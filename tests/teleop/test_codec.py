"""Bytes of messages: independent layouts, round trips, and refusal of everything else."""

import math
import struct
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from teleop_messages import EXAMPLES, FRAME, MESSAGES, POSE, mutate

from pilotfish.teleop import codec, wire_fields
from pilotfish.teleop.codec import LAYOUTS, PRIORITIES, Kind, decode, encode, payload_size, priority
from pilotfish.teleop.errors import MalformedMessage
from pilotfish.teleop.messages import MAX_PIECES, MODES, Envelope, Hello, Message

pytestmark = pytest.mark.usefixtures("unchecked")  # annotation checks draw from `random`

COMMAND, REPORT = EXAMPLES[Kind.COMMAND], EXAMPLES[Kind.REPORT]
NUMBER_AT = {  # position of a float in the bytes, by kind and name
    (Kind.COMMAND, "pose"): 14,
    (Kind.COMMAND, "twist"): 42,
    (Kind.COMMAND, "grip"): 66,
    (Kind.WELCOME, "max_budget"): 12,
    (Kind.REQUEST, "budget"): 5,
    (Kind.REQUEST, "envelope"): 13,
}


def floats_at(kind: Kind) -> list[int]:
    """Return the position of every float in the bytes of a kind."""
    codes = [code for _, field in LAYOUTS[kind].fields for code in field.codes]
    return [struct.calcsize("<" + "".join(codes[:n])) for n, code in enumerate(codes) if code == "f"]


def test_command_bytes_equal_layout_written_by_hand() -> None:
    expected = struct.pack("<IIIH", 7, 5, 2, 1250) + np.array([*POSE, *[0.125] * 6, 0.5], "<f4").tobytes()
    assert encode(COMMAND) == expected + bytes([1, 1, 1])  # mode, skill, clutch without dead-man


def test_piece_and_status_bytes_equal_layout_written_by_hand() -> None:
    piece = bytes(32) + struct.pack("<IHH", 1000, 1, 40) + b"x" * 40 + bytes(920)
    assert encode(EXAMPLES[Kind.SKILL_PIECE]) == piece
    assert encode(EXAMPLES[Kind.SKILL_STATUS]) == bytes(32) + b"\x01\x01" + bytes(126) + b"\x80"


@pytest.mark.parametrize("kind", Kind)
def test_decode_encoded_example_equals_it(kind: Kind) -> None:
    """The numbers of the examples are exact in single precision, but for positions."""
    payload = encode(EXAMPLES[kind])
    assert len(payload) == payload_size(kind)
    assert encode(decode(kind, payload)) == payload
    if kind not in (Kind.COMMAND, Kind.REPORT):
        assert decode(kind, payload) == EXAMPLES[kind]


def leaves(value: Any) -> list[Any]:
    if isinstance(value, tuple):
        return [leaf for each in value for leaf in leaves(each)]
    if hasattr(value, "__dataclass_fields__"):
        return [leaf for name in value.__dataclass_fields__ for leaf in leaves(getattr(value, name))]
    return [value]


@pytest.mark.parametrize("kind", Kind)
@given(data=st.data())
@settings(max_examples=60)
def test_decode_encoded_message_is_near_and_gives_same_bytes(kind: Kind, data: st.DataObject) -> None:
    message = data.draw(MESSAGES[kind])
    payload = encode(message)
    decoded = decode(kind, payload)
    assert encode(decoded) == payload
    for one, other in zip(leaves(message), leaves(decoded), strict=True):
        assert type(one) is type(other)
        assert one == (pytest.approx(other, rel=1e-6, abs=2e-7) if isinstance(one, float) else other)


@pytest.mark.parametrize("kind", Kind)
@given(seed=st.integers(0, 2**32))
@settings(max_examples=100)
def test_decode_accepted_mutant_is_canonical(kind: Kind, seed: int) -> None:
    """Bytes differ only where a quaternion was normalised; the message then stays the same."""
    mutant = mutate(encode(EXAMPLES[kind]), Random(seed))
    try:
        message = decode(kind, mutant)
    except MalformedMessage:
        return
    again = encode(message)
    assert decode(kind, again) == message
    assert again == mutant or kind in (Kind.COMMAND, Kind.REPORT)
    if again != mutant:
        poses = [
            n for n, leaf in enumerate(np.frombuffer(mutant, "u1") != np.frombuffer(again, "u1")) if leaf
        ]
        assert all(is_in_quaternion(kind, n) for n in poses)


def is_in_quaternion(kind: Kind, position: int) -> bool:
    start = 0
    for name, field in LAYOUTS[kind].fields:
        size = struct.calcsize("<" + "".join(field.codes))
        if start <= position < start + size:
            offset = position - start
            if name == "frames":
                return (offset - 1) % 32 >= 16
            return name in ("pose", "target") and offset >= 12
        start += size
    return False


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("kind", [kind for kind in Kind if floats_at(kind)])
def test_decode_not_finite_number_in_any_float_raises(kind: Kind, bad: float) -> None:
    payload = encode(EXAMPLES[kind])
    for start in floats_at(kind):
        mutant = payload[:start] + struct.pack("<f", bad) + payload[start + 4 :]
        with pytest.raises(MalformedMessage, match="expected finite numbers"):
            decode(kind, mutant)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("kind", Kind)
def test_encode_not_finite_number_in_any_float_raises(kind: Kind, bad: float) -> None:
    """Every float of the dataclass, `valid`, envelopes and frames included."""
    message, found = EXAMPLES[kind], 0
    for wrong in with_each_float_replaced(message, bad):
        found += 1
        with pytest.raises(MalformedMessage, match="expected finite numbers"):
            encode(wrong)
    assert found == len([leaf for leaf in leaves(message) if isinstance(leaf, float)])


def with_each_float_replaced(value: Any, bad: float) -> list[Any]:
    if isinstance(value, float):
        return [bad]
    if isinstance(value, tuple):
        return [
            (*value[:n], wrong, *value[n + 1 :])
            for n, each in enumerate(value)
            for wrong in with_each_float_replaced(each, bad)
        ]
    if hasattr(value, "__dataclass_fields__"):
        return [
            replace(value, **{name: wrong})
            for name in value.__dataclass_fields__
            for wrong in with_each_float_replaced(getattr(value, name), bad)
        ]
    return []


def test_decode_not_finite_is_named_before_other_faults() -> None:
    payload = bytearray(encode(COMMAND))
    payload[-3:] = b"\xff\xff\xff"  # mode, skill, flags
    payload[42:46] = struct.pack("<f", math.nan)
    with pytest.raises(MalformedMessage, match="twist has a value of nan"):
        decode(Kind.COMMAND, bytes(payload))


ENVELOPE = EXAMPLES[Kind.REQUEST].envelope  # type: ignore[union-attr]
REQUEST = EXAMPLES[Kind.REQUEST]
PIECE = EXAMPLES[Kind.SKILL_PIECE]
WRONG: list[tuple[Message, str]] = [
    (replace(COMMAND, grip=1.001), "grip is 1.001, expected 0 to 1"),
    (replace(COMMAND, grip=-0.001), "grip is -0.001, expected 0 to 1"),
    (replace(COMMAND, pose=(*POSE[:3], 0.0, 0.0, 0.0, 0.0)), "pose has a quaternion of norm 0"),
    (replace(COMMAND, pose=(*POSE[:3], 1.0011, 0.0, 0.0, 0.0)), "pose has a quaternion of norm 1.0011"),
    (replace(COMMAND, pose=POSE[:6], twist=(0.0,) * 7), "pose has 6 items, expected 7"),
    (replace(COMMAND, twist=(0.0,) * 5), "twist has 5 items, expected 6"),
    (replace(COMMAND, twist=(1e39,) * 6), "cannot be sent"),
    (replace(COMMAND, valid=-0.001), "valid is -0.001 s"),
    (replace(COMMAND, valid=65.536), "valid is 65.536 s, expected 0 to 65.535 s"),
    (replace(COMMAND, mode="sport"), "mode is 'sport', expected one of direct"),
    (replace(COMMAND, skill=8), "skill is 8, expected 0 to 7"),
    (replace(COMMAND, number=2**32), "cannot be sent"),
    (replace(COMMAND, number=-1), "cannot be sent"),
    (replace(REQUEST, budget=-1.0), "budget is -1 s, expected at least 0 s"),
    (replace(REQUEST, action=7), "cannot be sent"),
    (replace(REQUEST, envelope=replace(ENVELOPE, upper=(1.0, -1.0, 1.0))), "expected lower below upper"),
    (replace(REQUEST, envelope=replace(ENVELOPE, upper=(1.0, -1.0 + 1e-9, 1.0))), "expected lower below"),
    (replace(REQUEST, envelope=replace(ENVELOPE, duration=-1.0)), "expected at least 0"),
    (replace(REQUEST, envelope=replace(ENVELOPE, max_distance=-1.0)), "expected at least 0"),
    (replace(REQUEST, envelope=replace(ENVELOPE, modes=("sport",))), "expected one of direct"),
    (replace(REQUEST, envelope=replace(ENVELOPE, lower=(0.0,) * 2, upper=(1.0,) * 4)), "expected 3"),
    (replace(EXAMPLES[Kind.MISSION], skills=(bytes(32),) * 9), "skills has 9 items, expected at most 8"),
    (replace(EXAMPLES[Kind.MISSION], skills=(bytes(31),)), "skills has 31 items, expected 32"),
    (replace(PIECE, hash=bytes(33)), "hash has 33 items, expected 32"),
    (replace(PIECE, data=b"x" * 41), "data has 41 bytes, expected 40 in piece 1"),
    (replace(PIECE, data=b"x" * 961), "data has 961 items, expected at most 960"),
    (replace(PIECE, index=2), "index is 2"),
    (replace(PIECE, size=0), "size is 0 bytes"),
    (replace(PIECE, size=MAX_PIECES * 960 + 1, data=b"x" * 960), "expected 1 to 983040"),
    (replace(EXAMPLES[Kind.SKILL_STATUS], received=1 << 1024), "beyond the 1024 pieces"),
    (replace(REPORT, frames=(FRAME,) * 7), "frames has 7 items, expected at most 6"),
    (replace(REPORT, loop_age=-0.1), "loop_age is -0.1 s"),
    (replace(REPORT, misalignment=(-1.0, 0.0)), "misalignment is"),
    (replace(REPORT, authority=2.0), "authority is 2, expected 0 to 1"),
    ("a message", "message is of type str"),  # type: ignore[list-item]
]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("message", "match"), WRONG, ids=lambda value: value if isinstance(value, str) else ""
)
def test_encode_value_not_allowed_raises_its_name(message: Message, match: str) -> None:
    with pytest.raises(MalformedMessage, match=match):
        encode(message)


def changed(kind: Kind, position: int, new: bytes) -> bytes:
    payload = bytearray(encode(EXAMPLES[kind]))
    payload[position : position + len(new) or None] = new
    return bytes(payload)


CHANGES: list[tuple[Kind, int, bytes, str]] = [
    (Kind.COMMAND, 70, bytes([4]), "mode is 4, expected 0 to 3"),
    (Kind.COMMAND, 72, bytes([4]), "flags is 0x04, expected zero in all but the lowest 2 bits"),
    (Kind.COMMAND, 26, struct.pack("<4f", 1.0011, 0, 0, 0), "norm 1.0011"),
    (Kind.REPORT, 435, bytes([32]), "flags is 0x20"),
    (Kind.REPORT, 4, bytes([6]), "state is 6, expected 0 to 5"),
    (Kind.REPORT, 5, bytes([11]), "reason is 11, expected 0 to 10"),
    (Kind.REPORT, 7, bytes([14]), "refusal is 14, expected 0 to 13"),
    (Kind.REPORT, 431, bytes([1]), "frames has padding that is not zero"),
    (Kind.REPORT, 434, bytes([0x80]), "frames has padding that is not zero"),
    (Kind.REPORT, 242, bytes([7]), "frames has 7 items, expected at most 6"),
    (Kind.REQUEST, 4, bytes([7]), "action is 7, expected 0 to 6"),
    (Kind.REQUEST, 45, bytes([16]), "modes is 0x10"),
    (Kind.MISSION, 4, bytes([9]), "skills has 9 items, expected at most 8"),
    (Kind.MISSION, 260, bytes([1]), "skills has padding that is not zero"),
    (Kind.SKILL_PIECE, 999, bytes([1]), "data has padding that is not zero"),
    (Kind.SKILL_STATUS, 32, bytes([6]), "state is 6, expected 0 to 5"),
]


@pytest.mark.parametrize(("kind", "position", "new", "match"), CHANGES)
def test_decode_changed_byte_raises_its_name(kind: Kind, position: int, new: bytes, match: str) -> None:
    with pytest.raises(MalformedMessage, match=match):
        decode(kind, changed(kind, position, new))


@pytest.mark.parametrize("kind", Kind)
def test_decode_other_length_raises(kind: Kind) -> None:
    payload = encode(EXAMPLES[kind])
    for wrong in (payload + b"\0", payload[:-1], payload * 2, b""):
        if len(wrong) != len(payload):
            with pytest.raises(MalformedMessage, match=f"expected {len(payload)}"):
                decode(kind, wrong)


@pytest.mark.parametrize("kind", [-1, 0, 10, 255])
def test_decode_unknown_kind_raises(kind: int) -> None:
    for function in (lambda: decode(kind, b""), lambda: priority(kind), lambda: payload_size(kind)):
        with pytest.raises(MalformedMessage, match=f"kind is {kind}, expected 1 to 9"):
            function()


def test_settle_random_quaternions_reach_bytes_that_do_not_change(rng: np.random.Generator) -> None:
    """Norms within the tolerance; some components near the one that is computed, and some nearly zero."""
    q = rng.normal(size=(20_000, 4))
    q[::4, rng.integers(4)] *= 1e-7
    q[1::4] = rng.choice([-0.5, 0.5, 0.4, -0.4], size=(5_000, 4)) + rng.normal(scale=1e-7, size=(5_000, 4))
    q *= (1.0 + rng.uniform(-1e-3, 1e-3, size=(len(q), 1)) * 0.999) / np.linalg.norm(q, axis=1, keepdims=True)
    for each in q.tolist():
        unit = wire_fields.settle("pose", each)
        rounded = struct.unpack("<4f", struct.pack("<4f", *unit))
        assert wire_fields.settle("pose", rounded) == unit
        assert abs(math.hypot(*unit) - 1.0) < 4e-16
        np.testing.assert_allclose(
            unit, np.array(each) / math.hypot(*each), atol=4e-7
        )  # 1e-7 of the norm, and rounding, over 0.4


@pytest.mark.parametrize("value", [-0.0, 0.0, 1e-45, -1e-45, 1.1754942e-38, 3.4028235e38, -3.4028235e38])
def test_decode_extreme_finite_number_keeps_its_bits(value: float) -> None:
    message = replace(COMMAND, pose=(value, *POSE[1:]), twist=(value,) * 6)
    decoded = decode(Kind.COMMAND, encode(message))
    assert struct.pack("<f", decoded.twist[0]) == struct.pack("<f", value)
    assert encode(decoded) == encode(message)


def test_envelope_without_duration_needs_no_volume() -> None:
    message = replace(REQUEST, envelope=Envelope())
    assert decode(Kind.REQUEST, encode(message)) == message


def test_tables_cover_every_kind_and_message() -> None:
    assert set(LAYOUTS) == set(PRIORITIES) == set(EXAMPLES) == set(Kind)
    assert {layout.message for layout in LAYOUTS.values()} == set(Message.__args__)
    for kind, layout in LAYOUTS.items():
        named = {name for name, _ in layout.fields} | set(layout.flags)
        assert named == set(layout.message.__dataclass_fields__), kind
    assert len(MODES) <= 8
    assert codec.kind_of(Hello()) is Kind.HELLO


def test_priority_stop_first_report_last() -> None:
    order = [Kind.STOP, Kind.REQUEST, Kind.COMMAND, Kind.SKILL_PIECE, Kind.REPORT]
    values = [priority(kind) for kind in order]
    assert values == sorted(set(values))
    assert priority(Kind.HELLO) == priority(Kind.WELCOME) == priority(Kind.REQUEST)
