"""Reproduce a skill in a new situation: adapt, plan, track and roll out in one call.

A linear controller needs columns in R^n. Where a skill has orientations on S^3, the plan and the controller
are those of a tangent chart, and the motion is mapped back to S^3; no caller sees the chart unless it asks
for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.control import Feedback, Motion, Reference, double_integrator, track
from pilotfish.demonstrations import Frame, Layout, MovingFrame, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, Skill, adapt
from pilotfish.planning.conditioning import condition_on
from pilotfish.planning.costs import default_control_cost
from pilotfish.planning.plan import (
    plan_states,
    reference_from_states,
    require_start,
)
from pilotfish.planning.tangent_chart import TangentChart, tangent_chart
from pilotfish.planning.via_points import ViaPoint
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type, short_list, shorten_repr

MAX_DEFAULT_WORK = 2**34  # squared steps times states of a plan of default horizon: a few seconds


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """Motion of a skill in one situation, with the controller that makes it.

    Attributes:
        adapted: Skill adapted to the frames.
        tangent_chart: Tangent chart of the orientations on S^3; None if the skill has none.
        states: State of each step of the plan.
        reference: Targets and weights, in tangent columns.
        feedback: Gains and feedforward, in tangent columns.
        motion: States in the columns of the skill; inputs are accelerations in tangent columns.
    """

    adapted: AdaptedSkill
    tangent_chart: TangentChart | None
    states: Int[Array, " T"]
    reference: Reference
    feedback: Feedback
    motion: Motion

    @property
    def tangent_skill(self) -> AdaptedSkill:
        """The adapted skill in tangent columns; the adapted skill itself if it has no orientation on S^3."""
        return self.tangent_chart.skill if self.tangent_chart else self.adapted

    @property
    def targets(self) -> Float[Array, "T D"]:
        """The targets of the plan in the columns of the skill."""
        targets = self.reference.targets
        return self.tangent_chart.to_manifold(targets) if self.tangent_chart else targets


def reproduce(
    skill: Skill,
    frames: Sequence[Frame | MovingFrame],
    start: Float[Array, " D"] | None = None,
    *,
    horizon: int | None = None,
    via_points: Sequence[ViaPoint] = (),
    control_cost: float | Float[Array, "m m"] | None = None,
    covariance_regularisation: float | None = None,
    stepwise: bool = False,
) -> Reproduction:
    """Reproduce a skill where the objects are now, as the motion of a unit mass on every axis.

    Args:
        skill: Learned skill whose columns are coordinates, then the derivative of each.
        frames: Frame of each object, in any order.
        start: State of the robot at the first step; None starts where the demonstrations began.
        horizon: Number of steps; None takes the mean length of the demonstrations. The movement takes all of
            them, so that another horizon makes it slower or faster.
        via_points: Points that the motion passes, from `via_point`.
        control_cost: R, the cost of squared acceleration, or the number that multiplies the identity; a
            larger value gives a softer motion. None derives R from the scales of the skill, see `costs.py`.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared]. None takes (s / 1000)^2 for a column of scale s.
        stepwise: Whether to plan as published, see `plan`.

    Returns:
        The motion, its controller and its plan.

    Raises:
        InvalidInput: If frames are missing, the columns have no derivatives, or an argument cannot be used.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> demonstrations = pf.io.synthetic_valve(rng)
        >>> fit = pf.learn(demonstrations, states=5, rng=rng)
        >>> pf.reproduce(fit.skill, demonstrations[0].frames, horizon=50).motion.x.shape
        (50, 14)

    Source:
        Tanwani 2018, sections 3.3-3.5; for S^3, Zeestraten et al. 2017, section V.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    adapted = adapt(skill, frames)
    coordinates_with_derivatives(adapted.layout)  # before the horizon, which may be missing too
    return reproduce_adapted(
        adapted,
        start,
        horizon=mean_demonstration_length(skill) if horizon is None else horizon,
        via_points=via_points,
        control_cost=control_cost,
        covariance_regularisation=covariance_regularisation,
        stepwise=stepwise,
    )


def reproduce_adapted(
    adapted: AdaptedSkill,
    start: Float[Array, " D"] | None = None,
    *,
    horizon: int,
    via_points: Sequence[ViaPoint] = (),
    control_cost: float | Float[Array, "m m"] | None = None,
    covariance_regularisation: float | None = None,
    stepwise: bool = False,
) -> Reproduction:
    """Reproduce a skill that is adapted already, such as with frames weighted by relevance.

    Args:
        adapted: Adapted skill, from `adapt`.
        start: State of the robot at the first step; None starts where the demonstrations began.
        horizon: Number of steps.
        via_points: Points that the motion passes, from `via_point`.
        control_cost: As for `reproduce`.
        covariance_regularisation: As for `reproduce`.
        stepwise: Whether to plan as published, see `plan`.

    Returns:
        The motion, its controller and its plan.

    Raises:
        InvalidInput: If the columns have no derivatives, or an argument cannot be used.
    """
    require_type(adapted, "adapted", AdaptedSkill, "adapt(skill, frames) returns one")
    axes = coordinates_with_derivatives(adapted.layout)
    chart = tangent_chart(adapted) if adapted.layout.orientations else None
    tangent_skill = chart.skill if chart else adapted
    points = [chart.via_point(point) if chart else point for point in via_points]
    if start is not None and chart:
        start = chart.to_tangent(require_start(start, adapted))
    aligned, states = plan_states(tangent_skill, start, horizon=horizon, via_points=points, stepwise=stepwise)
    reference = reference_from_states(aligned, states, covariance_regularisation, end_point=not stepwise)
    if points:
        reference = condition_on(reference, points, tangent_skill.layout)
    R = default_control_cost(tangent_skill) if control_cost is None else control_cost
    feedback = track(double_integrator(axes, adapted.period), reference, R)
    if start is None:
        ends = None if stepwise else aligned.endpoints
        start = ends.means[0] if ends else reference.targets[0]
    motion = feedback.rollout(start)
    x = chart.to_manifold(motion.x) if chart else motion.x
    x = _hold_scalars(x, states, adapted, clip=not points)
    return Reproduction(adapted, chart, states, reference, feedback, Motion(x, motion.u, motion.period))


def _hold_scalars(
    x: Float[Array, "T D"], states: Int[Array, " T"], adapted: AdaptedSkill, *, clip: bool
) -> Float[Array, "T D"]:
    """Return the motion with columns that switch at one of their values, and scalars in their range.

    A column that switches has the value of the state, and no derivative. The first row is the start.
    """
    demonstrated, layout = adapted.demonstrated, adapted.layout
    if demonstrated is None:
        return x
    x, lowest, highest = x.copy(), demonstrated.lowest, demonstrated.highest
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is not Quantity.SCALAR or part.derivative:
            continue
        if clip:
            low, high = np.minimum(lowest, x[0])[columns], np.maximum(highest, x[0])[columns]
            x[1:, columns] = x[1:, columns].clip(low, high)
        for column in range(columns.start, columns.stop):
            if layout.names[column] in demonstrated.switches:
                is_high = adapted.means[states[1:], column] > 0.5 * (lowest + highest)[column]
                x[1:, column] = np.where(is_high, highest[column], lowest[column])
                if (rate := layout.rate_column(column)) is not None:
                    x[1:, rate] = 0.0
    return x


def coordinates_with_derivatives(layout: Layout) -> int:
    """Return the number of coordinates, each of which has its derivative in the second half of the columns.

    An orientation on S^3 has three: its rotation vector, and its angular velocity in body axes.

    Args:
        layout: Columns of a skill.

    Raises:
        InvalidInput: If the columns are others, so that a double integrator cannot follow them.
    """
    tangent = layout.tangent
    half = tangent.width // 2
    first = [p for p, columns in zip(tangent.parts, tangent.slices, strict=True) if columns.stop <= half]
    second = tangent.parts[len(first) :]
    if [(p.name, p.size, p.derivative + 1) for p in first] != [
        (p.name, p.size, p.derivative) for p in second
    ]:
        fix = (
            "learn from recordings that have both"
            if any(part.derivative for part in tangent.parts)
            else "learn it again with them: pf.add_derivatives, or pilotfish learn --velocities"
        )
        raise InvalidInput(
            f"the columns are {short_list(layout.names)}, expected coordinates, then the derivative of each; "
            f"{fix}"
        )
    return half


def mean_demonstration_length(skill: Skill) -> int:
    """Return the mean number of steps of the demonstrations that a skill was learned from.

    Args:
        skill: Learned skill.

    Raises:
        InvalidInput: If the skill does not state it, or a plan of this length would take long.
    """
    source = skill.provenance
    if not source.demonstrations or source.datapoints < 2 * len(source.demonstrations):
        raise InvalidInput("the skill does not state the length of its demonstrations; pass a horizon")
    steps = round(source.datapoints / len(source.demonstrations))
    if steps**2 * skill.states > MAX_DEFAULT_WORK:
        raise InvalidInput(
            f"the demonstrations of the skill have {steps} steps on average, which would take long to plan; "
            "pass a horizon"
        )
    return steps
