"""Plans that are to pass through given points at given times."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.control import Reference
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.gaussians import Gaussian, log_density
from pilotfish.models import AdaptedSkill, log_likelihood_of_states, on_the_half_of, posteriors
from pilotfish.planning.plan import plan, reference
from pilotfish.planning.via_points import Observation, ViaPoint, observations
from pilotfish.types import Array, Float
from pilotfish.validation import float_array

LEAST_SHARE = 1e-8  # of the plan's smallest deviation: the square of it is what float64 resolves beside 1
SEMIDEFINITE = 1e-6  # by how much rounding may let an entry exceed what the diagonal allows


def plan_through(
    model: AdaptedSkill,
    start: Float[Array, " D"],
    points: Sequence[ViaPoint],
    *,
    horizon: int,
    slack: float = 2e-3,
) -> Reference:
    """The plan from start for a motion that passes the points: they choose its states too, before and after.

    At every step the state is the most probable one given the start and all points, each a measurement of
    what a state does at that time; where a skill knows several ways, it takes one that leads by. The plan is
    then drawn `through` the points. Without any it is that of `plan`.
    Raises: InvalidInput, as plan and through do.
    Source: Tanwani 2018, equation 3.42, with the posterior of the state in the place of its prediction.
    """
    expected = plan(model, start, horizon=horizon, slack=slack)
    here = on_the_half_of(start, model)
    log_observed = np.zeros((horizon, model.states))
    log_observed[0] = log_likelihood_of_states(here, start[None])[0]
    for seen in observations(points, model.layout, expected.targets, expected.period):
        log_observed[seen.step] += _log_likelihoods(here, seen)
    states = posteriors(here.dynamics, log_observed).argmax(axis=1)
    return through(reference(here, states, slack), points, model.layout)


def _log_likelihoods(model: AdaptedSkill, seen: Observation) -> Float[Array, " K"]:
    """log p(what was measured | state), of the columns that were."""
    columns, noise = seen.columns, np.diag(seen.deviations**2)
    return np.array(
        [
            log_density(Gaussian(mean[columns], S[np.ix_(columns, columns)] + noise), seen.values[None])[0]
            for mean, S in zip(model.means, model.covariances, strict=True)
        ]
    )


def through(reference: Reference, points: Sequence[ViaPoint], layout: Layout) -> Reference:
    """The same plan, drawn to pass through the points at their times.

    At its step each point joins the cost as |x - value|^2 / deviation^2, so that tracking gives the mean of
    the trajectory distribution exp(-cost / 2), conditioned on having measured the points with these
    deviations: the motion bends early and comes back late, as smoothly as the effort asks. It misses a
    point by deviation^2 / (S + deviation^2) of the way there, S the variance of motions at that step
    (control.solve_batch): a deviation ten times smaller brings it a hundred times closer.
    Raises: InvalidInput, when points cannot be at any step of the plan, or contradict each other.
    Source: conditioning as in Paraschos et al. 2013, Probabilistic movement primitives, of the distribution
    that Calinon 2016 (see control.solve_batch) gives a tracking problem.
    """
    require_kind("reference", reference, Reference, "pf.plan makes one from an adapted skill")
    require_kind("layout", layout, Layout, "a skill holds one: skill.layout")
    targets, weights = _arrays(reference, layout)
    found = observations(points, layout, targets, reference.period)
    for point, seen in zip(points, found, strict=True):
        _refuse_lost(point, seen, weights)
    for seen in found:
        targets[seen.step], weights[seen.step] = _conditioned(targets[seen.step], weights[seen.step], seen)
    return replace(reference, targets=targets, weights=weights)


def _arrays(reference: Reference, layout: Layout) -> tuple[Float[Array, "T n"], Float[Array, "T n n"]]:
    """Copies of targets and weights.    Raises: InvalidInput, when they are not finite or of other shapes."""
    targets = np.array(float_array(reference.targets, "the reference's targets"))
    weights = np.array(float_array(reference.weights, "the reference's weights"))
    width = layout.width
    if targets.ndim != 2 or targets.shape[1] != width or weights.shape != (*targets.shape, width):
        raise InvalidInput(
            f"the reference has targets of shape {targets.shape} and weights of {weights.shape}, expected "
            f"(T, {width}) and (T, {width}, {width}): {', '.join(layout.names)}"
        )
    return targets, weights


def _refuse_lost(point: ViaPoint, seen: Observation, weights: Float[Array, "T n n"]) -> None:
    """A deviation far below the plan's own leaves no digits of the plan's weights beside its own.

    Raises: InvalidInput, naming the smallest that does.
    """
    largest = float(np.abs(np.diagonal(weights, axis1=1, axis2=2)).max(initial=0.0))
    least = LEAST_SHARE / np.sqrt(largest) if largest > 0.0 else 0.0
    if (given := float(seen.deviations.min())) < least:
        whole = point.deviation.min() / given  # the angle of an orientation is twice that of its quaternion
        raise InvalidInput(
            f"the deviation of {point.what!r} is {whole * given:g}, expected at least {whole * least:.3g}, "
            f"{LEAST_SHARE:g} of the plan's own: a smaller one is lost in rounding"
        )


def _conditioned(
    target: Float[Array, " n"], weight: Float[Array, "n n"], seen: Observation
) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """The Gaussian of one step, in terms of its precision, given a measurement of some columns.

    A weight may leave directions free; the target then keeps its place along those not measured either.
    """
    precisions = 1.0 / seen.deviations**2
    total = weight.copy()
    total[seen.columns, seen.columns] += precisions
    pull = np.zeros(len(target))
    pull[seen.columns] = precisions * (seen.values - target[seen.columns])
    # In units of each column's own precision nothing small is lost beside something large.
    diagonal = np.diag(total)
    unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = unit[:, None] * total * unit
    if not np.abs(scaled).max() <= 1.0 + SEMIDEFINITE:
        raise InvalidInput(
            f"weights[{seen.step}] of the reference has an entry larger than its diagonal allows, expected a "
            "positive semidefinite matrix"
        )
    shift = unit * np.linalg.lstsq(scaled, unit * pull)[0]
    return target + shift, total
