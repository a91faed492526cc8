"""What a skill must be, beyond shapes, before it is written and after it was read."""

from dataclasses import fields

import numpy as np

from pilotfish.demonstrations import require_name, require_period
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    Covariances,
    DenseCovariances,
    LatentCovariances,
    MultipleTransformCovariances,
    SemiTiedCovariances,
)
from pilotfish.models import (
    MOST_SKILL_NUMBERS,
    MOST_STATES,
    Durations,
    Dynamics,
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormalDurations,
    MarkovChain,
    NegativeBinomialDurations,
    PoissonDurations,
    SemiMarkovChain,
    Skill,
    Weights,
)
from pilotfish.types import Array, Float
from pilotfish.validation import LARGEST_MAGNITUDE, require_count, require_number, short_list, short_repr

MOST_FRAMES = 1000
LARGEST_MEAN = 1e101  # datapoints have at most 1e100
LONGEST_DURATION = 1e12  # steps; of parameters too
SHORTEST = 1e-12  # of parameters that are divided by
ROUNDING = 1e-6  # what probabilities may miss one by
SKEW = 1e-8  # what a covariance may differ from its transpose by, as a share of its largest entry


def require_agreement(skill: Skill) -> None:
    """Frames, columns and covariances are as many as the means say.    Raises: InvalidInput."""
    if skill.means.ndim != 3 or skill.means.size == 0:
        raise InvalidInput(f"means has shape {skill.means.shape}, expected (frames, states, columns)")
    P, K, D = skill.means.shape
    require_sizes(P, K, D)
    names = skill.frame_names
    if len(names) != P or len(skill.covariances) != P:
        raise InvalidInput(
            f"means has {P} frames, but there are {len(names)} frame names and "
            f"{len(skill.covariances)} covariances"
        )
    if len(set(names)) != P:
        raise InvalidInput(f"the frames are named {short_list(names)}, expected different names")
    for name in names:
        require_name(name, "a frame")
    if skill.layout.width != D:
        raise InvalidInput(f"means has {D} columns, but the layout has {skill.layout.width}")


def require_sizes(frames: int, states: int, columns: int) -> None:
    """Raise InvalidInput if a skill of these sizes would not fit in memory."""
    require_count(frames, "the number of frames", MOST_FRAMES, 1)
    require_count(states, "the number of states", MOST_STATES, 1)
    if (numbers := frames * states * columns**2) > MOST_SKILL_NUMBERS:
        raise InvalidInput(
            f"the covariances of {states} states in {frames} frames of {columns} columns have {numbers} "
            f"numbers, expected at most {MOST_SKILL_NUMBERS}"
        )


def require_sound(skill: Skill) -> None:
    """The numbers of a skill are a period, probabilities, durations and covariances.

    Raises: InvalidInput; NotPositiveDefinite, when a covariance is none.
    """
    require_period(skill.period, "period")
    _require_magnitude(skill.means, "means", LARGEST_MEAN)
    _require_dynamics(skill.dynamics)
    require_number(skill.provenance.regularisation, "provenance.regularisation", 0.0)
    if not np.isnan(skill.provenance.log_likelihood):  # as in what a stream reads out as
        require_number(skill.provenance.log_likelihood, "provenance.log_likelihood")
    for name, covariances in zip(skill.frame_names, skill.covariances, strict=True):
        _require_covariances(covariances, f"the covariance in frame {name!r} of state")


def _require_dynamics(dynamics: Dynamics) -> None:
    match dynamics:
        case Weights(weights):
            _require_distribution(weights, "weights")
        case MarkovChain(initial, transitions):
            _require_distribution(initial, "initial")
            for i, row in enumerate(transitions):
                _require_distribution(row, f"transitions[{i}]")
        case SemiMarkovChain(initial, transitions, durations):
            _require_distribution(initial, "initial")
            for i, row in enumerate(transitions):
                _require_departures(row, i)
            _require_durations(durations)


def _require_durations(durations: Durations) -> None:
    _require_parameters(durations)
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            means, deviations = durations.means, durations.deviations
            durations.log_table(1)
    except FloatingPointError as error:
        raise InvalidInput(f"durations cannot be computed with: {error}") from error
    for name, values in (("mean", means), ("deviation", deviations)):
        _require_magnitude(values, f"the {name} of durations", LONGEST_DURATION)


def _require_parameters(durations: Durations) -> None:
    for field in fields(durations):
        _require_magnitude(getattr(durations, field.name), f"durations.{field.name}", LONGEST_DURATION)
    match durations:
        case GaussianDurations(_, deviations):
            _require_positive(deviations, "durations.deviations", SHORTEST)
        case LogNormalDurations(_, log_deviations):
            _require_positive(log_deviations, "durations.log_deviations", SHORTEST)
        case PoissonDurations(more):
            _require_positive(more, "durations.more", SHORTEST)
        case GammaDurations(shapes, rates):
            _require_positive(shapes, "durations.shapes", SHORTEST)
            _require_positive(rates, "durations.rates", SHORTEST)
        case NegativeBinomialDurations(shapes, leaving):
            _require_positive(shapes, "durations.shapes", SHORTEST)
            _require_positive(leaving, "durations.leaving", SHORTEST)
            _require_positive(1.0 - leaving, "1 - durations.leaving", SHORTEST)
        case HistogramDurations(probabilities):
            for k, column in enumerate(probabilities.T):
                _require_distribution(column, f"durations.probabilities[:, {k}]")


def _require_departures(row: Float[Array, " K"], i: int) -> None:
    if row[i] != 0.0:
        raise InvalidInput(
            f"transitions[{i}, {i}] is {row[i]}, expected 0: durations say how long a state lasts"
        )
    if row.any():  # a row of zeros is a final state
        _require_distribution(row, f"transitions[{i}]")


def _require_distribution(p: Float[Array, " K"], place: str) -> None:
    with np.errstate(over="ignore"):
        total = float(p.sum())
    if (p < 0.0).any() or not abs(total - 1.0) <= ROUNDING:
        raise InvalidInput(
            f"{place} is {short_repr(p.tolist())} with sum {total:.9g}, expected probabilities of sum 1"
        )


def _require_positive(values: Float[Array, "..."], place: str, lowest: float = 0.0) -> None:
    if (bad := np.argwhere(~(values > lowest))).size:
        raise InvalidInput(
            f"{place}{bad[0].tolist()} is {values[tuple(bad[0])]}, expected more than {lowest:g}"
        )


def _require_magnitude(values: Float[Array, "..."], place: str, largest: float) -> None:
    if (bad := np.argwhere(~(np.abs(values) <= largest))).size:
        found = values[tuple(bad[0])]
        raise InvalidInput(
            f"{place}{bad[0].tolist()} is {found}, expected a finite number of at most {largest:g}"
        )


def _require_covariances(covariances: Covariances, what: str) -> None:
    match covariances:
        case DenseCovariances(dense):
            _require_symmetry(dense, what)
        case SemiTiedCovariances(_, variances, tying, dense):
            _require_symmetry(dense, what)
            if not 0.0 <= tying <= 1.0:
                raise InvalidInput(f"tying is {tying}, expected a number from 0 to 1")
            _require_positive(variances, "variances")
        case LatentCovariances(_, noise):
            if (bad := np.argwhere(noise < 0.0)).size:
                raise InvalidInput(f"noise{bad[0].tolist()} is {noise[tuple(bad[0])]}, expected at least 0")
        case MultipleTransformCovariances(_, variances, membership):
            _require_positive(variances, "variances")
            _require_one_of_each(membership)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as not finite
        whiteners = covariances.whiteners(what)
        dense = covariances.dense
    _require_magnitude(whiteners, f"the inverse deviation of {what} ", LARGEST_MAGNITUDE)
    _require_magnitude(dense, f"{what} ", LARGEST_MAGNITUDE**2)


def _require_symmetry(dense: Float[Array, "K D D"], what: str) -> None:
    skews = np.abs(dense - dense.transpose(0, 2, 1)).max(axis=(1, 2))
    if (bad := np.flatnonzero(skews > SKEW * np.abs(dense).max(axis=(1, 2)))).size:
        raise InvalidInput(
            f"{what} {bad[0]} differs from its transpose by {skews[bad[0]]:.3g}, expected symmetry"
        )


def _require_one_of_each(membership: Float[Array, "K C"]) -> None:
    ones = membership == 1.0
    if ((membership != 0.0) != ones).any() or (ones.sum(axis=1) != 1).any():
        raise InvalidInput(
            f"membership is {short_repr(membership.tolist())}, expected one 1 in each row, and 0 elsewhere"
        )
