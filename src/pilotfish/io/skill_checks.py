"""What a skill must be, beyond shapes, before it is written and after it was read."""

from dataclasses import fields

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Covariances
from pilotfish.models import (
    MAX_SKILL_NUMBERS,
    MAX_STATES,
    Dynamics,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
    Skill,
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
MAX_MEAN = 1e101  # datapoints have at most 1e100
MAX_DURATION_STEPS = 1e12  # steps; of parameters too
SUM_TOLERANCE = 1e-6  # what probabilities may miss one by


def validate_dimensions(skill: Skill) -> None:
    """Frames, columns and covariances are as many as the means say.    Raises: InvalidInput."""
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
    """Raise InvalidInput if a skill of these sizes would not fit in memory."""
    require_count(frames, "the number of frames", MAX_FRAMES, 1)
    require_count(states, "the number of states", MAX_STATES, 1)
    if (numbers := frames * states * columns**2) > MAX_SKILL_NUMBERS:
        raise InvalidInput(
            f"the covariances of {states} states in {frames} frames of {columns} columns have {numbers} "
            f"numbers, expected at most {MAX_SKILL_NUMBERS}"
        )


def validate_values(skill: Skill) -> None:
    """The numbers of a skill are a period, probabilities, durations and covariances.

    Raises: InvalidInput; NotPositiveDefinite, when a covariance is none.
    """
    require_period(skill.period, "period")
    _validate_magnitude(skill.means, "means", MAX_MEAN)
    _validate_dynamics(skill.dynamics)
    require_number(skill.provenance.regularisation, "provenance.regularisation", 0.0)
    if not np.isnan(skill.provenance.log_likelihood):  # as in what a stream reads out as
        require_number(skill.provenance.log_likelihood, "provenance.log_likelihood")
    for name, covariances in zip(skill.frame_names, skill.covariances, strict=True):
        _validate_covariances(covariances, f"the covariance in frame {name!r} of state")


def _validate_dynamics(dynamics: Dynamics) -> None:
    match dynamics:
        case MixtureWeights(weights):
            _validate_distribution(weights, "weights")
        case MarkovChain(initial, transitions):
            _validate_distribution(initial, "initial")
            for i, row in enumerate(transitions):
                _validate_distribution(row, f"transitions[{i}]")
        case SemiMarkovChain(initial, transitions, durations):
            _validate_distribution(initial, "initial")
            for i, row in enumerate(transitions):
                _validate_transition_row(row, i)
            _validate_durations(durations)


def _validate_durations(durations: DurationDistribution) -> None:
    _validate_duration_parameters(durations)
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            means, deviations = durations.means, durations.deviations
            durations.log_table(1)
    except FloatingPointError as error:
        raise InvalidInput(f"durations cannot be computed with: {error}") from error
    for name, values in (("mean", means), ("deviation", deviations)):
        _validate_magnitude(values, f"the {name} of durations", MAX_DURATION_STEPS)


def _validate_duration_parameters(durations: DurationDistribution) -> None:
    for field in fields(durations):
        _validate_magnitude(getattr(durations, field.name), f"durations.{field.name}", MAX_DURATION_STEPS)
    durations.validate()


def _validate_transition_row(row: Float[Array, " K"], i: int) -> None:
    if row[i] != 0.0:
        raise InvalidInput(
            f"transitions[{i}, {i}] is {row[i]}, expected 0: durations say how long a state lasts"
        )
    if row.any():  # a row of zeros is a final state
        _validate_distribution(row, f"transitions[{i}]")


def _validate_distribution(p: Float[Array, " K"], place: str) -> None:
    with np.errstate(over="ignore"):
        total = float(p.sum())
    if (p < 0.0).any() or not abs(total - 1.0) <= SUM_TOLERANCE:
        raise InvalidInput(
            f"{place} is {short_repr(p.tolist())} with sum {total:.9g}, expected probabilities of sum 1"
        )


def _validate_positive(values: Float[Array, "..."], place: str, lowest: float = 0.0) -> None:
    if (bad := np.argwhere(~(values > lowest))).size:
        raise InvalidInput(
            f"{place}{bad[0].tolist()} is {values[tuple(bad[0])]}, expected more than {lowest:g}"
        )


def _validate_magnitude(values: Float[Array, "..."], place: str, largest: float) -> None:
    if (bad := np.argwhere(~(np.abs(values) <= largest))).size:
        found = values[tuple(bad[0])]
        raise InvalidInput(
            f"{place}{bad[0].tolist()} is {found}, expected a finite number of at most {largest:g}"
        )


def _validate_covariances(covariances: Covariances, what: str) -> None:
    covariances.validate_parameters(what)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as not finite
        precision_cholesky = covariances.precision_cholesky(what)
        dense = covariances.dense
    _validate_magnitude(precision_cholesky, f"the inverse deviation of {what} ", MAX_MAGNITUDE)
    _validate_magnitude(dense, f"{what} ", MAX_MAGNITUDE**2)
