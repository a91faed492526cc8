"""Checks of a skill beyond the shapes of its arrays, before it is written and after it was read.

Bounds keep every number that the library computes from a skill finite. Covariance structures and duration
distributions check their own parameters.
"""

from dataclasses import fields

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Covariances, DenseCovariances
from pilotfish.models import (
    MAX_STATES,
    DemonstrationStatistics,
    Dynamics,
    SemiMarkovChain,
    Skill,
    coordinate_parts,
)
from pilotfish.models.durations import DurationDistribution
from pilotfish.types import Array, Float
from pilotfish.validation import (
    MAX_MAGNITUDE,
    require_count,
    require_name,
    require_number,
    require_period,
    short_list,
    short_repr,
)

MAX_FRAMES = 1000
MAX_SKILL_NUMBERS = 2**26  # in the dense covariances of all states in all frames: 512 MiB
MAX_MEAN = 1e101  # datapoints are at most 1e100
MAX_DURATION_STEPS = 1e12  # of means, deviations and parameters of durations
MIN_SCALE = 1e-50  # its square and the reciprocal of that are finite
SUM_TOLERANCE = 1e-6  # of the sum of probabilities


def validate_dimensions(skill: Skill) -> None:
    """Check that frames, columns and covariances match the shape of the means.

    Args:
        skill: Skill to check.

    Raises:
        InvalidInput: If one does not.
    """
    if skill.means.ndim != 3 or skill.means.size == 0:
        raise InvalidInput(f"means has shape {skill.means.shape}, expected (frames, states, columns)")
    P, K, D = skill.means.shape
    validate_sizes(P, K, D)
    names = skill.frame_names
    if len(names) != P or len(skill.covariances) != P:
        raise InvalidInput(
            f"means has {P} frames, but there are {len(names)} frame names and "
            f"{len(skill.covariances)} covariances"
        )
    if len(set(names)) != P:
        raise InvalidInput(f"the frames are named {short_list(names)}, expected different names")
    for name in names:
        require_name(name, "the name of a frame")
    if skill.layout.width != D:
        raise InvalidInput(f"means has {D} columns, but the layout has {skill.layout.width}")


def validate_sizes(frames: int, states: int, columns: int) -> None:
    """Check that a skill of these sizes fits in memory.

    Args:
        frames: Number of frames.
        states: Number of states.
        columns: Number of columns.

    Raises:
        InvalidInput: If a number is too large, or all covariances together are.
    """
    require_count(frames, "the number of frames", MAX_FRAMES, 1)
    require_count(states, "the number of states", MAX_STATES, 1)
    if (numbers := frames * states * columns**2) > MAX_SKILL_NUMBERS:
        raise InvalidInput(
            f"the covariances of {states} states in {frames} frames of {columns} columns have {numbers} "
            f"numbers, expected at most {MAX_SKILL_NUMBERS}"
        )


def validate_values(skill: Skill) -> None:
    """Check the period, the probabilities, the durations and the covariances of a skill.

    Args:
        skill: Skill with arrays of valid shapes.

    Raises:
        InvalidInput: If a number is out of bounds.
        NotPositiveDefinite: If a covariance is not positive definite.
    """
    require_period(skill.period, "period")
    _validate_magnitude(skill.means, "means", MAX_MEAN)
    _validate_dynamics(skill.dynamics)
    _validate_demonstrated(skill)
    if not np.isnan(skill.provenance.log_likelihood):  # NaN: unknown, as for a skill of an online model
        require_number(skill.provenance.log_likelihood, "provenance.log_likelihood")
    for name, covariances in zip(skill.frame_names, skill.covariances, strict=True):
        _validate_covariances(covariances, f"the covariance in frame {name!r} of state")


def _validate_demonstrated(skill: Skill) -> None:
    """Check what the skill keeps of its demonstrations: variances, scales, ranges and end points."""
    E, D = skill.layout.tangent.width, skill.layout.width
    if (given := skill.regularisation) is not None:
        _validate_column_values(given, "regularisation", E, 0.0, MAX_MAGNITUDE**2)
    if skill.demonstrated is not None:
        _validate_statistics(skill.demonstrated, skill)
    if (endpoints := skill.endpoints) is not None:
        P = len(skill.frame_names)
        if endpoints.means.shape != (P, 2, D) or endpoints.variances.shape != (P, 2, E):
            raise InvalidInput(
                f"endpoints have shapes {endpoints.means.shape} and {endpoints.variances.shape}, expected "
                f"({P}, 2, {D}) and ({P}, 2, {E})"
            )
        _validate_magnitude(endpoints.means, "endpoints.means", MAX_MEAN)
        _validate_magnitude(endpoints.variances, "endpoints.variances", MAX_MAGNITUDE**2)
        _validate_covariances(
            DenseCovariances(endpoints.variances.reshape(-1, E)[:, None] * np.eye(E)),
            "the variance of end point",
        )


def _validate_statistics(demonstrated: DemonstrationStatistics, skill: Skill) -> None:
    """Check scales and ranges of the demonstrations."""
    E, D = skill.layout.tangent.width, skill.layout.width
    _validate_column_values(demonstrated.scales, "demonstrated.scales", E, MIN_SCALE, MAX_MEAN)
    for name in ("lowest", "highest"):
        _validate_column_values(getattr(demonstrated, name), f"demonstrated.{name}", D, -MAX_MEAN, MAX_MEAN)
    if (bad := np.flatnonzero(demonstrated.lowest > demonstrated.highest)).size:
        raise InvalidInput(f"demonstrated.lowest[{bad[0]}] is above demonstrated.highest[{bad[0]}]")
    if unknown := set(demonstrated.switches) - set(skill.layout.names):
        raise InvalidInput(
            f"demonstrated.switches has {short_list(sorted(unknown))}, expected names of columns: "
            f"{short_list(skill.layout.names)}"
        )
    parts, ranges = len(list(coordinate_parts(skill.layout))), demonstrated.motion
    for name in ("smallest_sizes", "largest_sizes", "speeds", "accelerations", "start_distances"):
        label = f"demonstrated.motion.{name}"
        _validate_column_values(getattr(ranges, name), label, parts, 0.0, MAX_MAGNITUDE**2)
    for field in fields(frames := demonstrated.frames):
        values = getattr(frames, field.name)
        _validate_magnitude(values, f"demonstrated.frames.{field.name}", MAX_MEAN)
        if len(values) != len(skill.frame_names):
            raise InvalidInput(
                f"demonstrated.frames.{field.name} has {len(values)} rows, expected one for each of the "
                f"{len(skill.frame_names)} frames"
            )


def _validate_column_values(
    values: Float[Array, " D"], label: str, width: int, lowest: float, highest: float
) -> None:
    if values.shape != (width,):
        raise InvalidInput(f"{label} has shape {values.shape}, expected ({width},)")
    if (bad := np.flatnonzero(~((values >= lowest) & (values <= highest)))).size:
        raise InvalidInput(
            f"{label}[{bad[0]}] is {values[bad[0]]}, expected a number from {lowest:g} to {highest:g}"
        )


def _validate_dynamics(dynamics: Dynamics) -> None:
    for field in fields(dynamics):
        values = getattr(dynamics, field.name)
        if field.name in ("weights", "initial"):
            _validate_distribution(values, field.name)
        elif field.name == "transitions":
            for i, row in enumerate(values):
                _validate_transitions(row, i, isinstance(dynamics, SemiMarkovChain))
        elif field.name == "durations":
            _validate_durations(values)


def _validate_durations(durations: DurationDistribution) -> None:
    for field in fields(durations):
        _validate_magnitude(getattr(durations, field.name), f"durations.{field.name}", MAX_DURATION_STEPS)
    durations.validate()
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            means, deviations = durations.means, durations.deviations
            durations.log_table(1)
    except FloatingPointError as error:
        raise InvalidInput(f"durations give numbers that are not finite: {error}") from error
    for name, values in (("mean", means), ("deviation", deviations)):
        _validate_magnitude(values, f"the {name} of durations", MAX_DURATION_STEPS)


def _validate_transitions(row: Float[Array, " K"], i: int, semi_markov: bool) -> None:
    if semi_markov and row[i] != 0.0:
        raise InvalidInput(
            f"transitions[{i}, {i}] is {row[i]}, expected 0: durations model the time in a state"
        )
    if not semi_markov or row.any():  # a row of zeros is a final state
        _validate_distribution(row, f"transitions[{i}]")


def _validate_distribution(p: Float[Array, " K"], label: str) -> None:
    with np.errstate(over="ignore"):
        total = float(p.sum())
    if (p < 0.0).any() or not abs(total - 1.0) <= SUM_TOLERANCE:
        raise InvalidInput(
            f"{label} is {short_repr(p.tolist())} with sum {total:.9g}, expected probabilities of sum 1"
        )


def _validate_magnitude(values: Float[Array, "..."], label: str, maximum: float) -> None:
    if (bad := np.argwhere(~(np.abs(values) <= maximum))).size:
        index = bad[0].tolist()
        raise InvalidInput(
            f"{label}{index} is {values[tuple(index)]}, expected a finite number of at most {maximum:g}"
        )


def _validate_covariances(covariances: Covariances, label: str) -> None:
    covariances.validate_parameters(label)
    with np.errstate(over="ignore", invalid="ignore"):  # numbers that overflow are refused as not finite
        precision_cholesky = covariances.precision_cholesky(label)
        dense = covariances.dense
    _validate_magnitude(precision_cholesky, f"the precision factor of {label} ", MAX_MAGNITUDE)
    _validate_magnitude(dense, f"{label} ", MAX_MAGNITUDE**2)
