"""Transfer of skills in pieces: named by the hash of their content, and verified at the robot.

The operator splits the bytes of a skill; the robot collects the pieces of the skills of the mission. Pieces
may arrive in any order and more than once. The number of stored bytes is bounded by the mission.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.teleop.codec import require_consistent
from pilotfish.teleop.errors import MalformedMessage, UnsuitableSkill
from pilotfish.teleop.messages import (
    HASH_SIZE,
    MAX_MISSION,
    MAX_PIECES,
    PIECE_SIZE,
    SkillPiece,
    SkillState,
    SkillStatus,
)
from pilotfish.validation import shorten_repr

_COMPLETE = (SkillState.READY, SkillState.UNREADABLE, SkillState.UNSUITABLE)


@dataclass(frozen=True, slots=True)
class StoredSkill:
    """One skill of the mission at the robot.

    Attributes:
        status: Its status.
        size: Number of all bytes; 0 before the first piece.
        pieces: Bytes of each piece, empty if it is missing; no pieces before the first and after the last.
        decoded: The skill, if it is READY.
    """

    status: SkillStatus
    size: int = 0
    pieces: tuple[bytes, ...] = field(default=(), repr=False)
    decoded: Any = field(default=None, repr=False, compare=False)


@shorten_repr
@dataclass(frozen=True, slots=True)
class SkillStore:
    """Skills of the mission at the robot.

    Attributes:
        skills: Skills in the order of the mission, each once.
    """

    skills: tuple[StoredSkill, ...] = ()

    def status(self, hash: bytes) -> SkillStatus:  # noqa: A002 # as in SkillStatus
        """Return the status of a skill; MISSING if it is not expected.

        Args:
            hash: Hash of the skill.
        """
        stored = self._find(hash)
        return stored.status if stored else SkillStatus(hash, SkillState.MISSING, 0)

    def skill(self, hash: bytes) -> Any:  # noqa: A002 # as in SkillStatus
        """Return a skill that is READY; None otherwise.

        Args:
            hash: Hash of the skill.
        """
        stored = self._find(hash)
        return stored.decoded if stored else None

    def _find(self, hash: bytes) -> StoredSkill | None:  # noqa: A002 # as in SkillStatus
        return next((stored for stored in self.skills if stored.status.hash == hash), None)


def skill_hash(data: bytes) -> bytes:
    """Return the name of a skill: the SHA-256 of its bytes.

    Args:
        data: All bytes of a skill file.
    """
    return hashlib.sha256(data).digest()


def split_skill(data: bytes) -> tuple[SkillPiece, ...]:
    """Return the pieces of a skill.

    Args:
        data: All bytes of a skill file.

    Raises:
        InvalidInput: If it has no bytes, or too many.
    """
    if not 1 <= len(data) <= MAX_PIECES * PIECE_SIZE:
        raise InvalidInput(f"skill has {len(data)} bytes, expected 1 to {MAX_PIECES * PIECE_SIZE}")
    name = skill_hash(data)
    starts = range(0, len(data), PIECE_SIZE)
    return tuple(
        SkillPiece(name, len(data), n, data[start : start + PIECE_SIZE]) for n, start in enumerate(starts)
    )


def missing_pieces(status: SkillStatus, n: int) -> tuple[int, ...]:
    """Return the indices of the pieces that the operator must send.

    A skill that arrived needs none, even if it cannot be used: the same bytes would be refused again.

    Args:
        status: Status of the skill at the robot.
        n: Number of pieces of the skill.

    Raises:
        InvalidInput: If a skill cannot have this number of pieces.
    """
    if not 1 <= n <= MAX_PIECES:
        raise InvalidInput(f"n is {n}, expected 1 to {MAX_PIECES} pieces")
    if status.state in _COMPLETE:
        return ()
    return tuple(index for index in range(n) if not status.received >> index & 1)


def expect_skills(store: SkillStore, hashes: Sequence[bytes]) -> SkillStore:
    """Return the store for a mission: skills in both missions are kept, others dropped.

    A skill that arrived with a wrong hash is expected again.

    Args:
        store: Store.
        hashes: Hash of each skill of the mission; one may occur more than once.

    Raises:
        InvalidInput: If there are too many skills, or a hash has another length.
    """
    if len(hashes) > MAX_MISSION:
        raise InvalidInput(f"mission has {len(hashes)} skills, expected at most {MAX_MISSION}")
    for each in hashes:
        if len(each) != HASH_SIZE:
            raise InvalidInput(f"hash has {len(each)} bytes, expected {HASH_SIZE}; skill_hash returns one")
    wrong = SkillState.WRONG_HASH
    known = {stored.status.hash: stored for stored in store.skills if stored.status.state is not wrong}
    return SkillStore(tuple(known.get(name) or _missing(name) for name in dict.fromkeys(hashes)))


def add_piece(store: SkillStore, piece: SkillPiece, decode_skill: Callable[[bytes], Any]) -> SkillStore:
    """Add a piece, and after the last one verify and decode the skill.

    A piece of another mission, one that arrived before, and one that contradicts the size of the skill change
    nothing. If the content has another hash, all pieces are dropped, so that they can be sent again.

    Args:
        store: Store.
        piece: Piece.
        decode_skill: Returns a skill from its bytes. Raises UnsuitableSkill if it has other columns or frames
            than the robot, and another SkillError if it cannot be read.

    Returns:
        Store with the piece.
    """
    stored = store._find(piece.hash)
    if stored is None or stored.status.state in _COMPLETE or not _fits(stored, piece):
        return store
    pieces = stored.pieces or (b"",) * -(-piece.size // PIECE_SIZE)
    if pieces[piece.index]:
        return store
    pieces = (*pieces[: piece.index], piece.data, *pieces[piece.index + 1 :])
    status = SkillStatus(piece.hash, SkillState.PARTIAL, stored.status.received | 1 << piece.index)
    added = StoredSkill(status, piece.size, pieces)
    if all(pieces):
        added = _decode(added, decode_skill)
    return replace(store, skills=tuple(added if each is stored else each for each in store.skills))


def _fits(stored: StoredSkill, piece: SkillPiece) -> bool:
    if stored.size not in (0, piece.size):
        return False
    try:
        require_consistent(piece)
    except MalformedMessage:
        return False
    return True


def _decode(stored: StoredSkill, decode_skill: Callable[[bytes], Any]) -> StoredSkill:
    data, status = b"".join(stored.pieces), stored.status
    if skill_hash(data) != status.hash:
        return StoredSkill(SkillStatus(status.hash, SkillState.WRONG_HASH, 0))
    decoded = None
    try:
        decoded = decode_skill(data)
        state = SkillState.READY
    except UnsuitableSkill:
        state = SkillState.UNSUITABLE
    except SkillError:
        state = SkillState.UNREADABLE
    return StoredSkill(replace(status, state=state), stored.size, decoded=decoded)


def _missing(name: bytes) -> StoredSkill:
    return StoredSkill(SkillStatus(name, SkillState.MISSING, 0))
