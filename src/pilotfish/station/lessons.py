"""What was learned with one covariance structure, replayed in every situation, and its numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians import Structure
from pilotfish.models import Fit, covariance_parameters
from pilotfish.station.evaluation import (
    TRAINED,
    Replay,
    end_point_error,
    end_turn_error,
    largest_push,
    mean_squared_error,
)
from pilotfish.station.report import Table

HEAD = (
    "situation",
    "was it shown",
    "mean sq. error",
    "end point [mm]",
    "end turn [deg]",
    "largest push [m/s²]",
)
# Tanwani 2018, table 4.1, valve: mean squared error where shown and where new.
PUBLISHED = {"full": (".0021", ".0146"), "semi-tied(1)": (".0040", ".0119")}


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """A fit to the first demonstrations, and its replays in the situation of each.

    own begins at the demonstration's first point, mean at the mean of the skill's first state; seconds is
    the time it took to learn.
    """

    fit: Fit
    structure: Structure
    shown: tuple[Demonstration, ...]
    own: tuple[Replay, ...]
    mean: tuple[Replay, ...]
    seconds: float


def tables(lesson: Lesson) -> tuple[Table, Table]:
    """The numbers of every replay, from the first state's mean and from the demonstration's first point."""
    label = lesson.structure.label
    return (
        _table(f"{label} covariances, begun at the first state's mean", lesson.mean, lesson.shown),
        _table(f"{label} covariances, begun at the demonstration's first point", lesson.own, lesson.shown),
    )


def summary(lessons: Sequence[Lesson], published: bool) -> Table:
    """Mean squared errors where shown and where new, beside the published ones if they are comparable."""
    head = ("covariances", "parameters", "learned in [s]", "begun at", "error, shown", "error, new")
    rows = []
    for lesson in lessons:
        skill, label = lesson.fit.skill, lesson.structure.label
        count = covariance_parameters(lesson.structure, skill.states, skill.width, len(skill.frame_names))
        for begun, replays in (("first mean", lesson.mean), ("first point", lesson.own)):
            errors = [mean_squared_error(r.motion, d) for r, d in zip(replays, lesson.shown, strict=True)]
            row = [label, str(count), f"{lesson.seconds:.2f}", begun, *map(_error, _shares(errors))]
            rows.append((*row, *PUBLISHED.get(label, ("", ""))) if published else tuple(row))
    more = ("published, shown", "published, new") if published else ()
    return Table("Mean squared error of the seven coordinates of the pose", (*head, *more), tuple(rows))


def _table(caption: str, replays: Sequence[Replay], shown: Sequence[Demonstration]) -> Table:
    numbers = np.array([_numbers(r, d) for r, d in zip(replays, shown, strict=True)])  # (M, 4)
    names = [(d.name, "yes" if m < TRAINED else "no") for m, d in enumerate(shown)]
    names += [("mean where shown", "yes"), ("mean where new", "no")]
    numbers = np.vstack([numbers, numbers[:TRAINED].mean(axis=0), numbers[TRAINED:].mean(axis=0)])
    rows = [(*name, *_cells(*row)) for name, row in zip(names, numbers.tolist(), strict=True)]
    return Table(caption, HEAD, tuple(rows))


def _numbers(replay: Replay, demonstration: Demonstration) -> tuple[float, float, float, float]:
    motion = replay.motion
    return (
        mean_squared_error(motion, demonstration),
        1000.0 * end_point_error(motion, demonstration),
        float(np.degrees(end_turn_error(motion, demonstration))),
        largest_push(motion, demonstration.layout),
    )


def _cells(error: float, point: float, turn: float, push: float) -> tuple[str, ...]:
    return _error(error), f"{point:.0f}", f"{turn:.1f}", f"{push:.2f}"


def _shares(errors: Sequence[float]) -> tuple[float, float]:
    return float(np.mean(errors[:TRAINED])), float(np.mean(errors[TRAINED:]))


def _error(value: float) -> str:
    return f"{value:.4f}".removeprefix("0")
