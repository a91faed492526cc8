"""Plans that are to pass through given points at given times."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.control import Reference
from pilotfish.demonstrations import Layout
from pilotfish.errors import require_kind
from pilotfish.planning.via_points import Observation, ViaPoint, observations
from pilotfish.types import Array, Float


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
    for seen in observations(points, layout, reference):
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
