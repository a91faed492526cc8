"""Diagnostics: anomalies of a set of demonstrations, each of which is well formed."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Literal

import numpy as np

from pilotfish.demonstrations.layouts import Layout
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.signs import unwrap_orientations
from pilotfish.demonstrations.switches import switching_columns
from pilotfish.demonstrations.views import incompatibility
from pilotfish.types import Array, Float, Int
from pilotfish.validation import short_list

MAX_DURATION_RATIO = 2.0  # of the longest to the shortest demonstration
MIN_JUMP_RATIO = 5.0  # of a step to the steps before and after it
MIN_JUMP_FRACTION = 0.05  # of the diagonal of the part's range


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """An anomaly of a set of demonstrations.

    Attributes:
        severity: "note" if it may be intended, "warning" if it should be checked before learning, "error" if
            learning refuses the set.
        location: Demonstration or frame.
        message: What was found, with the nearest fix.
    """

    severity: Literal["note", "warning", "error"]
    location: str
    message: str


def diagnose(demonstrations: Sequence[Demonstration]) -> tuple[Diagnostic, ...]:
    """Find anomalies of a set of demonstrations.

    These are differences in layout, period or frames, duplicates, very different lengths, frames that are the
    same everywhere, constant columns, and jumps.

    Args:
        demonstrations: Any number of demonstrations.

    Returns:
        The anomalies; empty if there are none.
    """
    if not demonstrations:
        return (Diagnostic("error", "the set", "has no demonstrations, expected at least one"),)
    found = list(_incompatibilities(demonstrations))
    if not found:
        found += [*_constant_frames(demonstrations)]
    found += [*_duplicates(demonstrations), *_lengths(demonstrations)]
    switches = _switches_by_layout(demonstrations)
    for m, demo in enumerate(demonstrations):
        unwrapped, label = replace(demo, x=unwrap_orientations(demo.x, demo.layout)), _label(m, demo)
        found += [*_constant_columns(label, unwrapped), *_jumps(label, unwrapped, switches[demo.layout])]
    return tuple(found)


def _switches_by_layout(demonstrations: Sequence[Demonstration]) -> dict[Layout, tuple[str, ...]]:
    """Return the columns that switch in all demonstrations of each layout."""
    rows: dict[Layout, list[Float[Array, "T D"]]] = {}
    for demo in demonstrations:
        rows.setdefault(demo.layout, []).append(demo.x)
    return {layout: switching_columns(np.concatenate(x), layout) for layout, x in rows.items()}


def _label(m: int, demo: Demonstration) -> str:
    return f"demonstration {m} ({demo.name})" if demo.name else f"demonstration {m}"


def _incompatibilities(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    for m, demo in enumerate(demonstrations):
        if reason := incompatibility(demonstrations[0], demo):
            yield Diagnostic("error", _label(m, demo), f"and the first demonstration {reason}")


def _constant_frames(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    if len(demonstrations) < 2:
        return
    for frames in zip(*(demo.frames for demo in demonstrations), strict=True):
        first = frames[0]
        same = all(np.array_equal(first.A, f.A) and np.array_equal(first.b, f.b) for f in frames[1:])
        if same and not first.is_world:
            message = "is the same in every demonstration: its influence on the skill cannot be learned"
            yield Diagnostic("note", f"frame {first.name!r}", message)


def _duplicates(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    first: dict[tuple[tuple[int, ...], bytes], int] = {}
    for n, demo in enumerate(demonstrations):
        rows = demo.x + 0.0  # minus zero becomes zero
        m = first.setdefault((rows.shape, sha256(rows.tobytes()).digest()), n)
        if m < n:
            original = _label(m, demonstrations[m])
            message = f"has the same rows as {original}; a copy counts as a second demonstration"
            yield Diagnostic("warning", _label(n, demo), message)


def _lengths(demonstrations: Sequence[Demonstration]) -> Iterator[Diagnostic]:
    durations = [len(demo.x) * demo.period for demo in demonstrations]
    m, n = int(np.argmin(durations)), int(np.argmax(durations))
    if durations[n] > MAX_DURATION_RATIO * durations[m]:
        message = (
            f"lasts {durations[n]:.3g} s, {_label(m, demonstrations[m])} {durations[m]:.3g} s; "
            "remove rows that do not belong to the task"
        )
        yield Diagnostic("warning", _label(n, demonstrations[n]), message)


def _constant_columns(label: str, demo: Demonstration) -> Iterator[Diagnostic]:
    constant = np.flatnonzero(np.ptp(demo.x, axis=0) == 0)
    if constant.size:
        names = short_list([repr(demo.layout.names[column]) for column in constant])
        yield Diagnostic("note", label, f"is constant in {names}; its variance is then the regularisation")


def _jumps(label: str, demo: Demonstration, switches: Collection[str]) -> Iterator[Diagnostic]:
    """Find jumps of coordinates in columns that do not switch."""
    names = demo.layout.names
    for part, columns in zip(demo.layout.parts, demo.layout.slices, strict=True):
        smooth = [c for c in range(columns.start, columns.stop) if names[c] not in switches]
        rows = _jump_rows(demo.x[:, smooth]) if part.derivative == 0 else np.zeros(0, dtype=np.int64)
        if rows.size:
            message = (
                f"{part.name} jumps at row {rows[0]} (first is 0), {rows.size} times in all; "
                "rows may be missing or repeated"
            )
            yield Diagnostic("warning", label, message)


def _jump_rows(x: Float[Array, "T d"]) -> Int[Array, " J"]:
    """Return the rows reached by a step that is far longer than the steps before and after it."""
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    before = np.concatenate([[0.0], steps[:-1]])
    after = np.concatenate([steps[1:], [0.0]])
    diagonal = float(np.linalg.norm(np.ptp(x, axis=0)))
    jumps = (steps > MIN_JUMP_RATIO * np.maximum(before, after)) & (steps > MIN_JUMP_FRACTION * diagonal)
    return np.flatnonzero(jumps).astype(np.int64) + 1
