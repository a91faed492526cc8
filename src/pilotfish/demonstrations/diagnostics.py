"""Diagnostics: anomalies of a set of demonstrations, each of which is well formed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Literal, cast

import numpy as np

from pilotfish.demonstrations.anomalies_in_rows import Anomaly, row_anomalies
from pilotfish.demonstrations.anomalies_of_frames import frame_anomalies, missing_frame
from pilotfish.demonstrations.anomalies_of_orientations import order_anomalies, sign_anomalies
from pilotfish.demonstrations.layouts import Layout
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.signs import unwrap_orientations
from pilotfish.demonstrations.switches import switching_columns
from pilotfish.demonstrations.views import incompatibility
from pilotfish.types import Array, Float
from pilotfish.validation import short_list, shorten_repr

MAX_DURATION_RATIO = 2.0  # of the longest to the shortest demonstration
Severity = Literal["note", "warning", "error"]
Found = tuple[int, Anomaly]  # number of a demonstration, and what was found in it

# Nearest fix in Python of each kind of anomaly that has one.
FIXES = {
    "held rows": "learn from every n-th row: demonstration(x[::n], n * period, ...)",
    "times": "resample the recording with build_demonstration, or correct the period",
    "units": "convert the columns to SI units",
    "size": "convert the columns if they are in another unit",
    "wrap-around": "numpy.unwrap(x, axis=0) removes the jumps",
    "quaternion order": "numpy.roll(q, 1, axis=1) makes w x y z of x y z w",
    "lost frame": "interpolate the pose over those rows",
    "held frame": "interpolate the pose over those rows",
    "far frame": "convert its position to metres",
    "missing frame": "record the pose of the object, and add it with frame_from_pose",
}


@shorten_repr
@dataclass(frozen=True, slots=True)
class Diagnostic:
    """An anomaly of a set of demonstrations.

    Attributes:
        severity: "note" if it may be intended, "warning" if it should be checked before learning, "error" if
            learning refuses the set.
        location: Demonstration or frame.
        message: What was found.
        kind: Name of the anomaly, such as "held rows".
        fix: Nearest fix in Python; "" where the message has it.
    """

    severity: Severity
    location: str
    message: str
    kind: str = ""
    fix: str = ""


def diagnose(demonstrations: Sequence[Demonstration]) -> tuple[Diagnostic, ...]:
    """Find anomalies of a set of demonstrations.

    These are differences in layout, period or frames, duplicates, very different lengths, implausible units
    and speeds, rows that are held, times that contradict the period, angles that wrap around, quaternions of
    opposite signs or in another order, jumps, constant columns, and frames that are the same everywhere,
    lost, held, mirrored, scaled, contradictory, far away or missing. An anomaly of several demonstrations is
    reported once, with the numbers of the first.

    Args:
        demonstrations: Any number of demonstrations.

    Returns:
        The anomalies; empty if there are none.
    """
    if not demonstrations:
        return (Diagnostic("error", "the set", "has no demonstrations, expected at least one"),)
    found = list(_incompatibilities(demonstrations))
    is_compatible = not found
    if is_compatible:
        found += [*_constant_frames(demonstrations)]
    found += [*_duplicates(demonstrations), *_lengths(demonstrations)]
    return (*found, *_join(demonstrations, list(_anomalies(demonstrations, is_compatible))))


def _anomalies(demonstrations: Sequence[Demonstration], is_compatible: bool) -> Iterator[Found]:
    """Yield the anomalies of single demonstrations, and those of the set with the number of each."""
    switches = _switches_by_layout(demonstrations)
    for m, demo in enumerate(demonstrations):
        unwrapped = replace(demo, x=unwrap_orientations(demo.x, demo.layout))
        for anomaly in (*row_anomalies(unwrapped, switches[demo.layout]), *frame_anomalies(demo)):
            yield m, anomaly
    if is_compatible:
        yield from sign_anomalies(demonstrations)
        for anomaly in (*order_anomalies(demonstrations), *missing_frame(demonstrations)):
            for m in range(len(demonstrations)):
                yield m, anomaly


def _join(demonstrations: Sequence[Demonstration], found: Sequence[Found]) -> Iterator[Diagnostic]:
    """Yield one diagnostic for the same anomaly of several demonstrations."""
    groups: dict[tuple[str, str, str], list[Found]] = {}
    for m, anomaly in found:
        groups.setdefault((anomaly.severity, anomaly.kind, anomaly.subject), []).append((m, anomaly))
    for members in groups.values():
        numbers = list(dict.fromkeys(m for m, _ in members))
        anomaly = members[0][1]
        location = _label(numbers[0], demonstrations[numbers[0]])
        if len(numbers) == len(demonstrations) > 1:
            location = "all demonstrations:"
        elif len(numbers) > 1:
            location = f"demonstrations {short_list([str(m) for m in numbers])}:"
        severity = cast(Severity, anomaly.severity)
        yield Diagnostic(severity, location, anomaly.message, anomaly.kind, FIXES.get(anomaly.kind, ""))


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
