"""What is odd about a set of demonstrations, though each of them is well formed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from hashlib import sha256

import numpy as np

from pilotfish.demonstrations.frame_views import disagreement
from pilotfish.demonstrations.frames import Frame, MovingFrame, is_world
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.signs import without_flips
from pilotfish.types import Array, Float, Int
from pilotfish.validation import short_list

VERY_DIFFERENT = 2.0  # times the length of the shortest
JUMP = 5.0  # times the steps before and after
JUMP_SHARE = 0.05  # of the way across all that the part ever covers


class Severity(Enum):
    """What to make of a finding."""

    NOTE = "note"  # may be as intended
    WARNING = "warning"  # look before learning
    ERROR = "error"  # learning from these together is refused


@dataclass(frozen=True, slots=True)
class Finding:
    """Something odd: where, and what, with the nearest fix."""

    severity: Severity
    place: str
    message: str


def check(demonstrations: Sequence[Demonstration]) -> tuple[Finding, ...]:
    """All that is odd: disagreement, duplicates, unequal lengths, frames that never
    differ, constant columns, jumps and held rows. Nothing found is an empty tuple.
    """
    if not demonstrations:
        return (Finding(Severity.ERROR, "the set", "holds no demonstrations, expected at least one"),)
    found = list(_disagreements(demonstrations))
    if not found:
        found += [*_frames_that_never_differ(demonstrations)]
    found += [*_duplicates(demonstrations), *_lengths(demonstrations)]
    for m, demo in enumerate(demonstrations):
        here = replace(demo, x=without_flips(demo.x, demo.layout.turns))
        found += [*_constant_columns(_place(m, demo), here), *_jumps(_place(m, demo), here)]
    return tuple(found)


def _place(m: int, demo: Demonstration) -> str:
    return f"demonstration {m} ({demo.name})" if demo.name else f"demonstration {m}"


def _disagreements(demonstrations: Sequence[Demonstration]) -> Iterator[Finding]:
    for m, demo in enumerate(demonstrations):
        if reason := disagreement(demonstrations[0], demo):
            yield Finding(Severity.ERROR, _place(m, demo), f"it and the first {reason}")


def _frames_that_never_differ(demonstrations: Sequence[Demonstration]) -> Iterator[Finding]:
    if len(demonstrations) < 2:
        return
    for frames in zip(*(demo.frames for demo in demonstrations), strict=True):
        if not is_world(frames[0]) and all(_same(frames[0], other) for other in frames[1:]):
            message = "is the same in every demonstration: how the skill follows it cannot be told from these"
            yield Finding(Severity.NOTE, f"frame {frames[0].name!r}", message)


def _same(given: Frame | MovingFrame, other: Frame | MovingFrame) -> bool:
    return np.array_equal(given.A, other.A) and np.array_equal(given.b, other.b)


def _duplicates(demonstrations: Sequence[Demonstration]) -> Iterator[Finding]:
    first: dict[tuple[tuple[int, ...], bytes], int] = {}
    for n, other in enumerate(demonstrations):
        rows = other.x + 0.0  # minus zero becomes zero
        m = first.setdefault((rows.shape, sha256(rows.tobytes()).digest()), n)
        if m < n:
            one = demonstrations[m]
            message = f"has the same rows as {_place(m, one)}; a copy counts as a second showing"
            yield Finding(Severity.WARNING, _place(n, other), message)


def _lengths(demonstrations: Sequence[Demonstration]) -> Iterator[Finding]:
    durations = [len(demo.x) * demo.period for demo in demonstrations]
    m, n = int(np.argmin(durations)), int(np.argmax(durations))
    if durations[n] > VERY_DIFFERENT * durations[m]:
        message = (
            f"lasts {durations[n]:.3g} s, {_place(m, demonstrations[m])} {durations[m]:.3g} s; "
            "cut what does not belong to the task"
        )
        yield Finding(Severity.WARNING, _place(n, demonstrations[n]), message)


def _constant_columns(place: str, demo: Demonstration) -> Iterator[Finding]:
    still = np.flatnonzero(np.ptp(demo.x, axis=0) == 0)
    if still.size:
        columns = demo.layout.names
        names = short_list([repr(columns[column]) for column in still])
        yield Finding(
            Severity.NOTE, place, f"never changes in {names}; learning then rests on regularisation"
        )


def _jumps(place: str, demo: Demonstration) -> Iterator[Finding]:
    for part, columns in zip(demo.layout.parts, demo.layout.slices, strict=True):
        rows = _jump_rows(demo.x[:, columns]) if part.derivative == 0 else np.zeros(0, dtype=np.int64)
        if rows.size:
            message = (
                f"{part.name} jumps at row {rows[0]} (first is 0), {rows.size} times in all; "
                "rows may be missing or held"
            )
            yield Finding(Severity.WARNING, place, message)


def _jump_rows(x: Float[Array, "T d"]) -> Int[Array, " J"]:
    """Rows reached by a step that is far longer than the steps before and after it."""
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    before = np.concatenate([[0.0], steps[:-1]])
    after = np.concatenate([steps[1:], [0.0]])
    covered = float(np.linalg.norm(np.ptp(x, axis=0)))
    sudden = (steps > JUMP * np.maximum(before, after)) & (steps > JUMP_SHARE * covered)
    return np.flatnonzero(sudden).astype(np.int64) + 1
