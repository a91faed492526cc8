"""What a skill must be, beyond shapes, before it is written and after it was read."""

from math import inf

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    Covariances,
    DenseCovariances,
    LatentCovariances,
    MultipleTransformCovariances,
    SemiTiedCovariances,
)
from pilotfish.models import (
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
from pilotfish.store.skills_fields import require_finite
from pilotfish.types import Array, Float

ROUNDING = 1e-6  # what probabilities may miss one by
SKEW = 1e-8  # what a covariance may differ from its transpose by, as a share of its largest entry


def require_agreement(skill: Skill) -> None:
    """Frames, columns and covariances are as many as the means say.    Raises: InvalidInput."""
    if skill.means.ndim != 3 or skill.means.size == 0:
        raise InvalidInput(f"means has shape {skill.means.shape}, expected (frames, states, columns)")
    P, _, D = skill.means.shape
    names = skill.frame_names
    if len(names) != P or len(skill.covariances) != P:
        raise InvalidInput(
            f"means has {P} frames, but there are {len(names)} frame names and "
            f"{len(skill.covariances)} covariances"
        )
    if len(set(names)) != P:
        raise InvalidInput(f"the frames are named {list(names)}, expected different names")
    if skill.layout.width != D:
        raise InvalidInput(f"means has {D} columns, but the layout has {skill.layout.width}")


def require_sound(skill: Skill) -> None:
    """The numbers of a skill are a period, probabilities, durations and covariances.

    Raises: InvalidInput; NotPositiveDefinite, when a covariance is none.
    """
    if not 0 < skill.period < inf:
        raise InvalidInput(f"period is {skill.period} s, expected a positive time")
    require_finite(skill.means, "means")
    _require_dynamics(skill.dynamics)
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
    match durations:
        case GaussianDurations(_, deviations):
            _require_positive(deviations, "durations.deviations")
        case LogNormalDurations(_, log_deviations):
            _require_positive(log_deviations, "durations.log_deviations")
        case PoissonDurations(more):
            _require_positive(more, "durations.more")
        case GammaDurations(shapes, rates):
            _require_positive(shapes, "durations.shapes")
            _require_positive(rates, "durations.rates")
        case NegativeBinomialDurations(shapes, leaving):
            _require_positive(shapes, "durations.shapes")
            _require_positive(leaving, "durations.leaving")
            _require_positive(1.0 - leaving, "1 - durations.leaving")
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
    if (p < 0.0).any() or abs(p.sum() - 1.0) > ROUNDING:
        raise InvalidInput(f"{place} is {p.tolist()} with sum {p.sum():.9g}, expected probabilities of sum 1")


def _require_positive(values: Float[Array, "..."], place: str) -> None:
    if (bad := np.argwhere(~(values > 0.0))).size:
        raise InvalidInput(f"{place}{bad[0].tolist()} is {values[tuple(bad[0])]}, expected more than 0")


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
        covariances.whiteners(what)


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
            f"membership is {membership.tolist()}, expected one 1 in each row, and 0 elsewhere"
        )
