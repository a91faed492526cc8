"""Condition a reference on via-points.

Tracking a reference gives the mean of the trajectory distribution exp(-cost / 2) (`control.solve_batch`). A
via-point is a measurement of some columns at one step with standard deviations s. It adds |x - value|^2 / s^2
to the cost of that step, so that tracking gives the mean of the conditioned distribution: the motion deviates
before and returns after the via-point, as smoothly as the control cost asks. The remaining error is the
fraction s^2 / (S + s^2) of the original distance, where S is the variance of motions at that step. A
deviation ten times smaller thus reduces the error a hundredfold.

In precision form, a Gaussian with mean m and precision Q conditioned on a measurement z of the columns C with
precision W = diag(1 / s^2) has precision Q + C' W C and mean m + (Q + C' W C)^-1 C' W (z - C m). Q may be
singular; the minimum-norm solution then keeps the target along directions that neither constrains.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.control import Reference
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.planning.via_points import ViaPoint, ViaPointObservation, observe_via_points
from pilotfish.types import Array, Float
from pilotfish.validation import float_array, require_type

MIN_RELATIVE_DEVIATION = 1e-8  # of the plan's smallest: its square is what float64 resolves beside 1
SEMIDEFINITE_TOLERANCE = 1e-6  # by which rounding may let an entry exceed the bound of the diagonal


def condition_on(reference: Reference, points: Sequence[ViaPoint], layout: Layout) -> Reference:
    """Return a reference conditioned on via-points.

    Args:
        reference: Targets and weights with a period, from `plan`.
        points: Via-points.
        layout: Columns of the reference.

    Returns:
        The reference with other targets and weights at the steps of the via-points.

    Raises:
        InvalidInput: If a point is at no step of the plan, points contradict each other, or a deviation is
            too small beside the weights.

    Source:
        Conditioning as in Paraschos et al. 2013, Probabilistic movement primitives, of the trajectory
        distribution of Calinon 2016 (`control.solve_batch`).
    """
    require_type(reference, "reference", Reference, "pf.plan makes one from an adapted skill")
    require_type(layout, "layout", Layout, "a skill has one: skill.layout")
    targets, weights = _copy_validated_arrays(reference, layout)
    observations = observe_via_points(points, layout, targets, reference.period)
    for point, observation in zip(points, observations, strict=True):
        _require_resolvable_deviation(point, observation, weights)
    for observation in observations:
        targets[observation.step], weights[observation.step] = _condition_step(
            targets[observation.step], weights[observation.step], observation
        )
    return replace(reference, targets=targets, weights=weights)


def _copy_validated_arrays(
    reference: Reference, layout: Layout
) -> tuple[Float[Array, "T n"], Float[Array, "T n n"]]:
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
    """Refuse a deviation so far below that of the plan that no digits of its weights would remain."""
    largest = float(np.abs(np.diagonal(weights, axis1=1, axis2=2)).max(initial=0.0))
    smallest = MIN_RELATIVE_DEVIATION / np.sqrt(largest) if largest > 0.0 else 0.0
    if (given := float(observation.deviations.min())) < smallest:
        scale = point.deviation.min() / given  # 2 for an orientation, whose deviation is an angle
        raise InvalidInput(
            f"the deviation of {point.name!r} is {scale * given:g}, expected at least "
            f"{scale * smallest:.3g}, {MIN_RELATIVE_DEVIATION:g} of that of the plan; a smaller one is lost "
            "in rounding"
        )


def _condition_step(
    target: Float[Array, " n"], weight: Float[Array, "n n"], observation: ViaPointObservation
) -> tuple[Float[Array, " n"], Float[Array, "n n"]]:
    """Condition the Gaussian of one step on a measurement, as at the head of this file."""
    columns, precisions = observation.columns, 1.0 / observation.deviations**2
    total = weight.copy()
    total[columns, columns] += precisions
    information = np.zeros(len(target))
    information[columns] = precisions * (observation.values - target[columns])
    # In units of each column's own precision, small entries are not lost beside large ones.
    diagonal = np.diag(total)
    unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = unit[:, None] * total * unit
    if not np.abs(scaled).max() <= 1.0 + SEMIDEFINITE_TOLERANCE:
        raise InvalidInput(
            f"weights[{observation.step}] of the reference has an entry larger than its diagonal allows, "
            "expected a positive semidefinite matrix"
        )
    shift = unit * np.linalg.lstsq(scaled, unit * information)[0]
    return target + shift, total
