"""What is odd about a set of demonstrations, though each of them is well formed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from hashlib import sha256

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame, is_world
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.signs import unwrap_orientation_starts
from pilotfish.demonstrations.views import incompatibility
from pilotfish.types import Array, Float, Int
from pilotfish.validation import short_list

MAX_DURATION_RATIO = 2.0  # times the length of the shortest
MIN_JUMP_RATIO = 5.0  # times the steps before and after
MIN_JUMP_FRACTION = 0.05  # of the way across all that the part ever covers


class Severity(Enum):
    """What to make of a finding."""

    NOTE = "note"  # may be as intended
    WARNING = "warning"  # look before learning
    ERROR = "error"  # learning from these together is refused


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """Something odd: where, and what, with the nearest fix."""

    severity: Severity
    place: str
    message: str


def diagnose(demonstrations: Sequence[Demonstration]) -> tuple[Diagnostic, ...]:
    """All that is odd: disagreement, duplicates, unequal lengths, frames that never
    differ, constant columns, jumps and held rows. Nothing found is an empty tuple.
    """
    if not demonstrations:
        return (Diagnostic(Severity.ERROR, "the set", "holds no demonstrations, expected at least one"),)
    found = list(_incompatibilities(demonstrations))
    if not found:
        found += [*_constant_frames(demonstrations)]
    found += [*_duplicates(demonstrations), *_lengths(demonstrations)]
    for m, demo in enumerate(demonstrations):
        here = replace(demo, x=unwrap_orientation_starts(demo.x, demo.layout.orientation_starts))
        found += [*_constant_columns(_label(m, demo), here), *_jumps(_label(m, demo), here)]
    return tuple(found)


def _label(m: int, demo: Demonstration) -> str:
    return f"demonstration {m} ({demo.name})" if demo.name else f"demonstration {m}"


def _incompatibilities(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    for m, demo in enumerate(demonstrations):
        if reason := incompatibility(demonstrations[0], demo):
            yield Diagnostic(Severity.ERROR, _label(m, demo), f"it and the first {reason}")


def _constant_frames(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    if len(demonstrations) < 2:
        return
    for frames in zip(*(demo.frames for demo in demonstrations), strict=True):
        if not is_world(frames[0]) and all(_equal_frames(frames[0], other) for other in frames[1:]):
            message = "is the same in every demonstration: how the skill follows it cannot be told from these"
            yield Diagnostic(Severity.NOTE, f"frame {frames[0].name!r}", message)


def _equal_frames(given: Frame | MovingFrame, other: Frame | MovingFrame) -> bool:
    return np.array_equal(given.A, other.A) and np.array_equal(given.b, other.b)


def _duplicates(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    first: dict[tuple[tuple[int, ...], bytes], int] = {}
    for n, other in enumerate(demonstrations):
        rows = other.x + 0.0  # minus zero becomes zero
        m = first.setdefault((rows.shape, sha256(rows.tobytes()).digest()), n)
        if m < n:
            one = demonstrations[m]
            message = f"has the same rows as {_label(m, one)}; a copy counts as a second showing"
            yield Diagnostic(Severity.WARNING, _label(n, other), message)


def _lengths(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    durations = [len(demo.x) * demo.period for demo in demonstrations]
    m, n = int(np.argmin(durations)), int(np.argmax(durations))
    if durations[n] > MAX_DURATION_RATIO * durations[m]:
        message = (
            f"lasts {durations[n]:.3g} s, {_label(m, demonstrations[m])} {durations[m]:.3g} s; "
            "cut what does not belong to the task"
        )
        yield Diagnostic(Severity.WARNING, _label(n, demonstrations[n]), message)


def _constant_columns(place: str, demo: Demonstration) -> Iterator[Diagnostic]:
    constant = np.flatnonzero(np.ptp(demo.x, axis=0) == 0)
    if constant.size:
        columns = demo.layout.names
        names = short_list([repr(columns[column]) for column in constant])
        yield Diagnostic(
            Severity.NOTE, place, f"never changes in {names}; learning then rests on regularisation"
        )


def _jumps(place: str, demo: Demonstration) -> Iterator[Diagnostic]:
    for part, columns in zip(demo.layout.parts, demo.layout.slices, strict=True):
        rows = _jump_rows(demo.x[:, columns]) if part.derivative == 0 else np.zeros(0, dtype=np.int64)
        if rows.size:
            message = (
                f"{part.name} jumps at row {rows[0]} (first is 0), {rows.size} times in all; "
                "rows may be missing or held"
            )
            yield Diagnostic(Severity.WARNING, place, message)


def _jump_rows(x: Float[Array, "T d"]) -> Int[Array, " J"]:
    """Rows reached by a step that is far longer than the steps before and after it."""
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    before = np.concatenate([[0.0], steps[:-1]])
    after = np.concatenate([steps[1:], [0.0]])
    covered = float(np.linalg.norm(np.ptp(x, axis=0)))
    jumps = (steps > MIN_JUMP_RATIO * np.maximum(before, after)) & (steps > MIN_JUMP_FRACTION * covered)
    return np.flatnonzero(jumps).astype(np.int64) + 1
