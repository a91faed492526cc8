"""What was learned with one covariance structure, replayed in every situation, and its numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.cli.demo.protocol import TRAINING_DEMONSTRATIONS
from pilotfish.cli.output.report import Table
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models import Fit
from pilotfish.planning import (
    Reproduction,
    end_orientation_error,
    end_position_error,
    largest_acceleration,
    mean_squared_error,
)

HEADER = (
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
class StructureEvaluation:
    """A fit to the first demonstrations, and its reproductions in the situation of each.

    own begins at the demonstration's first point, mean at the mean of the skill's first state; seconds is
    the time it took to learn.
    """

    fit: Fit
    structure: CovarianceStructure
    demonstrations: tuple[Demonstration, ...]
    from_first_point: tuple[Reproduction, ...]
    mean: tuple[Reproduction, ...]
    seconds: float


def error_tables(evaluation: StructureEvaluation) -> tuple[Table, Table]:
    """The numbers of every reproduction, from the first state's mean and from the demonstration's first point."""
    label = evaluation.structure.label
    return (
        _table(
            f"{label} covariances, begun at the first state's mean",
            evaluation.mean,
            evaluation.demonstrations,
        ),
        _table(
            f"{label} covariances, begun at the demonstration's first point",
            evaluation.from_first_point,
            evaluation.demonstrations,
        ),
    )


def summary_table(evaluations: Sequence[StructureEvaluation], published: bool) -> Table:
    """Mean squared errors where shown and where new, beside the published ones if they are comparable."""
    header = ("covariances", "parameters", "learned in [s]", "begun at", "error, shown", "error, new")
    rows = []
    for evaluation in evaluations:
        skill, label = evaluation.fit.skill, evaluation.structure.label
        count = len(skill.frame_names) * evaluation.structure.parameter_count(skill.states, skill.width)
        for start_name, reproductions in (
            ("first mean", evaluation.mean),
            ("first point", evaluation.from_first_point),
        ):
            errors = [
                mean_squared_error(r.motion, d)
                for r, d in zip(reproductions, evaluation.demonstrations, strict=True)
            ]
            row = [
                label,
                str(count),
                f"{evaluation.seconds:.2f}",
                start_name,
                *map(_format_error, _mean_errors(errors)),
            ]
            rows.append((*row, *PUBLISHED.get(label, ("", ""))) if published else tuple(row))
    more = ("published, shown", "published, new") if published else ()
    return Table("Mean squared error of the seven coordinates of the pose", (*header, *more), tuple(rows))


def _table(
    caption: str, reproductions: Sequence[Reproduction], demonstrations: Sequence[Demonstration]
) -> Table:
    numbers = np.array(
        [_error_measures(r, d) for r, d in zip(reproductions, demonstrations, strict=True)]
    )  # (M, 4)
    names = [(d.name, "yes" if m < TRAINING_DEMONSTRATIONS else "no") for m, d in enumerate(demonstrations)]
    names += [("mean where shown", "yes"), ("mean where new", "no")]
    numbers = np.vstack(
        [
            numbers,
            numbers[:TRAINING_DEMONSTRATIONS].mean(axis=0),
            numbers[TRAINING_DEMONSTRATIONS:].mean(axis=0),
        ]
    )
    rows = [(*name, *_format_measures(*row)) for name, row in zip(names, numbers.tolist(), strict=True)]
    return Table(caption, HEADER, tuple(rows))


def _error_measures(
    reproduction: Reproduction, demonstration: Demonstration
) -> tuple[float, float, float, float]:
    motion = reproduction.motion
    return (
        mean_squared_error(motion, demonstration),
        1000.0 * end_position_error(motion, demonstration),
        float(np.degrees(end_orientation_error(motion, demonstration))),
        largest_acceleration(motion, demonstration.layout),
    )


def _format_measures(error: float, point: float, turn: float, push: float) -> tuple[str, ...]:
    return _format_error(error), f"{point:.0f}", f"{turn:.1f}", f"{push:.2f}"


def _mean_errors(errors: Sequence[float]) -> tuple[float, float]:
    return float(np.mean(errors[:TRAINING_DEMONSTRATIONS])), float(np.mean(errors[TRAINING_DEMONSTRATIONS:]))


def _format_error(value: float) -> str:
    return f"{value:.4f}".removeprefix("0")
