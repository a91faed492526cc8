"""Progress of an attempt at a task: quantities that are recorded, what they mean, and why the task failed.

The physics decides what happened: each quantity is measured once per period during the execution, such as the
height of an object above its support, and the first phase that was not passed explains the failure.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import degrees
from typing import Any, Generic, TypeVar

import numpy as np

from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import shorten_repr

S = TypeVar("S")
Measurements = Mapping[str, float]
History = Mapping[str, Float[Array, " T"]]
"""Each quantity over the periods of an attempt."""


class Phase(StrEnum):
    """Phase of a manipulation task in which it can fail."""

    APPROACH = "approach"
    GRASP = "grasp"
    MOTION = "motion"
    GOAL = "goal"
    RELEASE = "release"
    CONTACT = "contact"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Failure:
    """Why an attempt failed.

    Attributes:
        phase: First phase that was not passed.
        summary: What went wrong in a few words without numbers, the same for all attempts that fail so.
        detail: What went wrong in this attempt, with numbers.
    """

    phase: Phase
    summary: str
    detail: str


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Progress(Generic[S]):
    """How progress at a task is measured and explained.

    Attributes:
        measure: Function (scene, situation) that returns the quantities to record.
        describe: Function from these quantities to what happens now, in a few words.
        explain: Function (history, outcome) that returns why the task failed.
    """

    measure: Callable[[Scene, S], Measurements]
    describe: Callable[[Measurements], str]
    explain: Callable[[History, Outcome], Failure]


def stack_measurements(measurements: Sequence[Measurements]) -> dict[str, Float[Array, " T"]]:
    """Return the history of each quantity.

    Args:
        measurements: Quantities of each period, with the same names.
    """
    names = measurements[0] if measurements else ()
    return {name: np.array([row[name] for row in measurements]) for name in names}


def explain_failure(progress: "Progress[Any] | None", history: History, outcome: Outcome) -> Failure | None:
    """Return why an attempt failed, or None if it succeeded.

    Args:
        progress: Progress of the task; without it, the reason of the outcome is the explanation.
        history: Quantities over the periods of the attempt.
        outcome: Result of the attempt.
    """
    if outcome.success:
        return None
    if progress is None or not history:
        return other_failure(outcome)
    return progress.explain(history, outcome)


def first_failure(checks: Sequence[tuple[Any, Phase, str, str]], outcome: Outcome) -> Failure:
    """Return the failure of the first check that holds; the reason of the outcome if none does.

    Args:
        checks: Whether the attempt failed so, phase, summary and detail.
        outcome: Result of the attempt.
    """
    for failed, phase, summary, detail in checks:
        if failed:
            return Failure(phase, summary, detail)
    return other_failure(outcome)


def other_failure(outcome: Outcome) -> Failure:
    """Return a failure that the reason of the outcome explains."""
    return Failure(Phase.OTHER, "not done", outcome.reason)


def first_true(condition: Bool[Array, " T"]) -> int:
    """Return the first index at which a condition holds, or its length if it never does."""
    return int(np.argmax(condition)) if condition.any() else len(condition)


def smallest(values: Float[Array, " T"]) -> float:
    """Return the smallest value that is a number; inf if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else np.inf


def in_mm(length: float) -> str:
    """Return a length [m] as text in mm."""
    return f"{1000.0 * length:.0f} mm" if abs(length) >= 0.0095 else f"{1000.0 * length:.1f} mm"


def in_degrees(angle: float) -> str:
    """Return an angle [rad] as text in degrees."""
    return f"{degrees(angle):.0f} degrees" if abs(degrees(angle)) >= 9.5 else f"{degrees(angle):.1f} degrees"
