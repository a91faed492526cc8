"""Plans that are to pass through given points at given times."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.control import Reference
from pilotfish.demonstrations import Layout
from pilotfish.errors import require_kind
from pilotfish.gaussians import Gaussian, log_density
from pilotfish.models import AdaptedSkill, log_likelihood_of_states, on_the_half_of, posteriors
from pilotfish.planning.plan import plan, reference
from pilotfish.planning.via_points import Observation, ViaPoint, observations
from pilotfish.types import Array, Float


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
    targets, weights = reference.targets.copy(), reference.weights.copy()
    for seen in observations(points, layout, reference.targets, reference.period):
        targets[seen.step], weights[seen.step] = _conditioned(targets[seen.step], weights[seen.step], seen)
    return replace(reference, targets=targets, weights=weights)


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
    shift = unit * np.linalg.lstsq(unit[:, None] * total * unit, unit * pull)[0]
    return target + shift, total
