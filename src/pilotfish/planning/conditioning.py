"""Condition a reference on points that the motion is to pass at given times."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.control import Reference
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.planning.via_points import ViaPoint, ViaPointObservation, observe_via_points
from pilotfish.types import Array, Float
from pilotfish.validation import float_array, require_type

MIN_RELATIVE_DEVIATION = (
    1e-8  # of the plan's smallest deviation: the square of it is what float64 resolves beside 1
)
SEMIDEFINITE_TOLERANCE = 1e-6  # by how much rounding may let an entry exceed what the diagonal allows


def condition_on(reference: Reference, points: Sequence[ViaPoint], layout: Layout) -> Reference:
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
    require_type(reference, "reference", Reference, "pf.plan makes one from an adapted skill")
    require_type(layout, "layout", Layout, "a skill holds one: skill.layout")
    targets, weights = _copy_validated_arrays(reference, layout)
    found = observe_via_points(points, layout, targets, reference.period)
    for point, observation in zip(points, found, strict=True):
        _require_resolvable_deviation(point, observation, weights)
    for observation in found:
        targets[observation.step], weights[observation.step] = _condition_step(
            targets[observation.step], weights[observation.step], observation
        )
    return replace(reference, targets=targets, weights=weights)


def _copy_validated_arrays(
    reference: Reference, layout: Layout
) -> tuple[Float[Array, "T n"], Float[Array, "T n n"]]:
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


def _require_resolvable_deviation(
    point: ViaPoint, observation: ViaPointObservation, weights: Float[Array, "T n n"]
) -> None:
    """A deviation far below the plan's own leaves no digits of the plan's weights beside its own.

    Raises: InvalidInput, naming the smallest that does.
    """
    largest = float(np.abs(np.diagonal(weights, axis1=1, axis2=2)).max(initial=0.0))
    least = MIN_RELATIVE_DEVIATION / np.sqrt(largest) if largest > 0.0 else 0.0
    if (given := float(observation.deviations.min())) < least:
        whole = point.deviation.min() / given  # the angle of an orientation is twice that of its quaternion
        raise InvalidInput(
            f"the deviation of {point.what!r} is {whole * given:g}, expected at least {whole * least:.3g}, "
            f"{MIN_RELATIVE_DEVIATION:g} of the plan's own: a smaller one is lost in rounding"
        )


def _condition_step(
    target: Float[Array, " n"], weight: Float[Array, "n n"], observation: ViaPointObservation
) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """The Gaussian of one step, in terms of its precision, given a measurement of some columns.

    A weight may leave directions free; the target then keeps its place along those not measured either.
    """
    measurement_precisions = 1.0 / observation.deviations**2
    total = weight.copy()
    total[observation.columns, observation.columns] += measurement_precisions
    pull = np.zeros(len(target))
    pull[observation.columns] = measurement_precisions * (observation.values - target[observation.columns])
    # In units of each column's own precision nothing small is lost beside something large.
    diagonal = np.diag(total)
    unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = unit[:, None] * total * unit
    if not np.abs(scaled).max() <= 1.0 + SEMIDEFINITE_TOLERANCE:
        raise InvalidInput(
            f"weights[{observation.step}] of the reference has an entry larger than its diagonal allows, expected a "
            "positive semidefinite matrix"
        )
    shift = unit * np.linalg.lstsq(scaled, unit * pull)[0]
    return target + shift, total
