"""Transfer of skills: any order of pieces, verification, bounded store."""

import hashlib
from dataclasses import replace
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.teleop.codec import decode, encode, kind_of
from pilotfish.teleop.errors import UnsuitableSkill
from pilotfish.teleop.messages import MAX_MISSION, MAX_PIECES, PIECE_SIZE, SkillPiece, SkillState
from pilotfish.teleop.skill_transfer import (
    SkillStore,
    add_piece,
    expect_skills,
    missing_pieces,
    skill_hash,
    split_skill,
)

DATA = bytes(Random(1).randbytes(2500))
NAME = hashlib.sha256(DATA).digest()


def read(data: bytes) -> Any:
    return ("skill", len(data))


def store_after(pieces: Any, decode_skill: Any = read) -> SkillStore:
    store = expect_skills(SkillStore(), [NAME])
    for piece in pieces:
        store = add_piece(store, piece, decode_skill)
    return store


@given(st.binary(min_size=1, max_size=3 * PIECE_SIZE), st.randoms(use_true_random=False))
def test_pieces_in_any_order_and_repeated_give_the_skill(data: bytes, rng: Random) -> None:
    pieces = list(split_skill(data)) * 2
    rng.shuffle(pieces)
    store = expect_skills(SkillStore(), [skill_hash(data)])
    for piece in pieces:
        sent = decode(kind_of(piece), encode(piece))
        store = add_piece(store, sent, lambda arrived: arrived)  # type: ignore[arg-type]
    assert store.skill(skill_hash(data)) == data
    assert store.status(skill_hash(data)).state is SkillState.READY


def test_split_skill_names_content_and_joins_to_it() -> None:
    pieces = split_skill(DATA)
    assert skill_hash(DATA) == NAME
    assert b"".join(piece.data for piece in pieces) == DATA
    assert [(piece.hash, piece.size, piece.index, len(piece.data)) for piece in pieces] == [
        (NAME, 2500, 0, 960),
        (NAME, 2500, 1, 960),
        (NAME, 2500, 2, 580),
    ]


@pytest.mark.parametrize(("length", "count"), [(1, 1), (960, 1), (961, 2), (960 * 1024, 1024)])
def test_split_skill_at_limits_of_pieces(length: int, count: int) -> None:
    pieces = split_skill(bytes(length))
    assert len(pieces) == count
    assert sum(len(piece.data) for piece in pieces) == length
    assert encode(pieces[-1])


@pytest.mark.parametrize("length", [0, 960 * 1024 + 1])
def test_split_skill_without_bytes_or_too_long_raises(length: int) -> None:
    with pytest.raises(InvalidInput, match=f"skill has {length} bytes, expected 1 to 983040"):
        split_skill(bytes(length))


def test_status_counts_pieces_until_ready() -> None:
    pieces, states = split_skill(DATA), []
    for count in range(4):
        status = store_after(pieces[:count]).status(NAME)
        states.append((status.state, status.received, missing_pieces(status, 3)))
    assert states == [
        (SkillState.MISSING, 0, (0, 1, 2)),
        (SkillState.PARTIAL, 0b1, (1, 2)),
        (SkillState.PARTIAL, 0b11, (2,)),
        (SkillState.READY, 0b111, ()),
    ]
    assert store_after(pieces[:2]).skill(NAME) is None
    assert store_after(pieces).skill(NAME) == ("skill", 2500)


def test_wrong_content_is_dropped_and_can_be_sent_again() -> None:
    pieces = split_skill(DATA)
    wrong = replace(pieces[1], data=bytes(960))
    store = store_after([pieces[0], wrong, pieces[2]])
    status = store.status(NAME)
    assert (status.state, status.received) == (SkillState.WRONG_HASH, 0)
    assert missing_pieces(status, 3) == (0, 1, 2)
    assert store.skills[0].pieces == ()
    for piece in pieces:
        store = add_piece(store, piece, read)
    assert store.skill(NAME) == ("skill", 2500)


@pytest.mark.parametrize(
    ("error", "state"),
    [(SkillError, SkillState.UNREADABLE), (UnsuitableSkill, SkillState.UNSUITABLE)],
)
def test_skill_that_cannot_be_used_has_its_state(error: type[SkillError], state: SkillState) -> None:
    def refuse(data: bytes) -> Any:
        raise error("refused")

    store = store_after(split_skill(DATA), refuse)
    assert store.status(NAME).state is state
    assert store.skill(NAME) is None
    assert missing_pieces(store.status(NAME), 3) == ()
    assert add_piece(store, split_skill(DATA)[0], read) is store


@pytest.mark.parametrize("n", [0, -1, 1025, 2**31])
def test_missing_pieces_impossible_number_raises(n: int) -> None:
    with pytest.raises(InvalidInput, match=f"n is {n}, expected 1 to 1024 pieces"):
        missing_pieces(store_after([]).status(NAME), n)


def test_decoder_is_called_once_with_verified_content_only() -> None:
    calls: list[bytes] = []
    pieces = split_skill(DATA)
    store_after([*pieces, *pieces], calls.append)
    store_after([replace(pieces[0], data=bytes(960)), *pieces], calls.append)
    assert calls == [DATA]


@pytest.mark.parametrize(
    "change",
    [
        {"size": 2501},
        {"size": 1900},
        {"index": 3},
        {"index": -1},
        {"data": b"x"},
        {"data": b""},
        {"size": 0},
        {"size": MAX_PIECES * PIECE_SIZE + 1},
        {"hash": bytes(32)},
    ],
)
def test_piece_that_contradicts_the_skill_is_ignored(change: dict[str, Any]) -> None:
    pieces = split_skill(DATA)
    store = store_after(pieces[:1])
    assert add_piece(store, replace(pieces[1], **change), read) is store


@pytest.mark.parametrize("change", [{"index": 3}, {"data": b"x"}, {"size": 0}, {"size": 10**9}])
def test_first_piece_that_contradicts_itself_is_ignored(change: dict[str, Any]) -> None:
    store = store_after([])
    assert add_piece(store, replace(split_skill(DATA)[0], **change), read) is store


def test_piece_that_is_not_expected_is_ignored() -> None:
    store = SkillStore()
    assert add_piece(store, split_skill(DATA)[0], read) is store
    assert store.status(NAME).state is SkillState.MISSING
    assert store.skill(NAME) is None


def test_expect_skills_keeps_common_skills_and_drops_others() -> None:
    store = store_after(split_skill(DATA))
    other = bytes(32)
    both = expect_skills(store, [other, NAME, NAME])
    assert [stored.status.hash for stored in both.skills] == [other, NAME]
    assert both.skill(NAME) == ("skill", 2500)
    assert expect_skills(both, [other]).skill(NAME) is None
    assert expect_skills(store, []) == SkillStore()


def test_expect_skills_too_many_or_wrong_hash_raises() -> None:
    with pytest.raises(InvalidInput, match="mission has 9 skills, expected at most 8"):
        expect_skills(SkillStore(), [bytes(32)] * (MAX_MISSION + 1))
    with pytest.raises(InvalidInput, match="hash has 3 bytes, expected 32"):
        expect_skills(SkillStore(), [b"abc"])


def test_store_is_bounded_by_mission() -> None:
    """Pieces of unknown skills, and of more bytes than the size, cannot add to it."""
    rng = Random(3)
    names = [rng.randbytes(32) for _ in range(MAX_MISSION)]
    store = expect_skills(SkillStore(), names)
    for _ in range(3000):
        name = rng.choice(names) if rng.random() < 0.5 else rng.randbytes(32)
        size = rng.choice((3 * PIECE_SIZE, 4000))
        index = rng.randrange(4)
        length = max(0, min(PIECE_SIZE, size - index * PIECE_SIZE))
        store = add_piece(store, SkillPiece(name, size, index, bytes(length)), read)
    assert len(store.skills) == MAX_MISSION
    assert sum(len(piece) for stored in store.skills for piece in stored.pieces) <= MAX_MISSION * 4000


def test_pieces_are_dropped_after_the_skill_is_ready() -> None:
    assert store_after(split_skill(DATA)).skills[0].pieces == ()
