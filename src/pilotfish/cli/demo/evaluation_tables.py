"""Tables of the demo: errors of the reproductions of each covariance structure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.cli.demo.protocol import TRAINING_DEMONSTRATIONS
from pilotfish.cli.output.tables import Table
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
from pilotfish.validation import shorten_repr

HEADER = (
    "situation",
    "demonstrated",
    "mean sq. error",
    "end position [mm]",
    "end orientation [deg]",
    "max. acceleration [m/s²]",
)
# Tanwani 2018, table 4.1, valve: mean squared error in demonstrated and in new situations.
PUBLISHED = {"full": (".0021", ".0146"), "semi-tied(1)": (".0040", ".0119")}


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class StructureEvaluation:
    """Fit with one covariance structure, and its reproductions in the situation of each demonstration.

    Attributes:
        fit: Fit to the first TRAINING_DEMONSTRATIONS demonstrations.
        structure: Covariance structure of the fit.
        demonstrations: All demonstrations.
        from_first_point: Reproductions that start at the first point of the demonstration.
        from_first_state: Reproductions that start at the mean of the skill's first state.
        seconds: Duration of learning [s].
    """

    fit: Fit
    structure: CovarianceStructure
    demonstrations: tuple[Demonstration, ...]
    from_first_point: tuple[Reproduction, ...]
    from_first_state: tuple[Reproduction, ...]
    seconds: float


def error_tables(evaluation: StructureEvaluation) -> tuple[Table, Table]:
    """Return the errors of every reproduction: a table for each kind of start."""
    label = evaluation.structure.label
    return (
        _error_table(
            f"{label} covariances, started at the mean of the first state",
            evaluation.from_first_state,
            evaluation.demonstrations,
        ),
        _error_table(
            f"{label} covariances, started at the first point of the demonstration",
            evaluation.from_first_point,
            evaluation.demonstrations,
        ),
    )


def summary_table(evaluations: Sequence[StructureEvaluation], *, published: bool) -> Table:
    """Return the mean squared errors in demonstrated and in new situations.

    Args:
        evaluations: Evaluation of each structure.
        published: Whether the published errors are added; they are comparable on the recorded data only.
    """
    header = ("covariances", "parameters", "learned in [s]", "start", "error, demonstrated", "error, new")
    rows = []
    for evaluation in evaluations:
        skill, label = evaluation.fit.skill, evaluation.structure.label
        count = len(skill.frame_names) * evaluation.structure.parameter_count(skill.states, skill.width)
        for start, reproductions in (
            ("first state", evaluation.from_first_state),
            ("first point", evaluation.from_first_point),
        ):
            pairs = zip(reproductions, evaluation.demonstrations, strict=True)
            errors = _mean_errors([mean_squared_error(r.motion, d) for r, d in pairs])
            row = (label, str(count), f"{evaluation.seconds:.2f}", start, *map(_format_error, errors))
            rows.append((*row, *(PUBLISHED.get(label, ("", "")) if published else ())))
    more = ("published, demonstrated", "published, new") if published else ()
    caption = "Published figure: mean squared error over seven coordinates, in m² and quaternion entries"
    return Table((*header, *more), tuple(rows), caption, right_aligned=True)


def _error_table(
    caption: str, reproductions: Sequence[Reproduction], demonstrations: Sequence[Demonstration]
) -> Table:
    errors = np.array(
        [_error_measures(r, d) for r, d in zip(reproductions, demonstrations, strict=True)]
    )  # (M, 4)
    names = [(d.name, "yes" if m < TRAINING_DEMONSTRATIONS else "no") for m, d in enumerate(demonstrations)]
    names += [("mean, demonstrated", "yes"), ("mean, new", "no")]
    means = [errors[:TRAINING_DEMONSTRATIONS].mean(axis=0), errors[TRAINING_DEMONSTRATIONS:].mean(axis=0)]
    rows = [
        (*name, _format_error(error), f"{position:.0f}", f"{orientation:.1f}", f"{acceleration:.2f}")
        for name, (error, position, orientation, acceleration) in zip(
            names, np.vstack([errors, means]).tolist(), strict=True
        )
    ]
    return Table(HEADER, tuple(rows), caption, right_aligned=True)


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


def _mean_errors(errors: Sequence[float]) -> tuple[float, float]:
    return float(np.mean(errors[:TRAINING_DEMONSTRATIONS])), float(np.mean(errors[TRAINING_DEMONSTRATIONS:]))


def _format_error(value: float) -> str:
    return f"{value:.4f}".removeprefix("0")
