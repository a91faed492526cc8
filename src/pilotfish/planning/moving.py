"""Reproduce a skill while the objects move: plan again each period with frames that are extrapolated."""

from dataclasses import replace

import numpy as np

from pilotfish.control import Reference, double_integrator, track
from pilotfish.demonstrations import (
    Frame,
    Layout,
    MovingFrame,
    add_derivatives,
    demonstration,
    moving_frame_from_poses,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    Pose,
    from_rotation_vector,
    multiply,
    normalise,
    rotation_vector_in_world,
)
from pilotfish.models import AdaptedSkill, Skill, adapt, align_quaternion_signs
from pilotfish.planning.plan import CONTROL_COST, COVARIANCE_REGULARISATION, reference_from_states
from pilotfish.planning.reproduction import coordinates_with_derivatives
from pilotfish.planning.tangent_chart import tangent_chart
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type


def moving_frame_reference(
    now: AdaptedSkill, later: AdaptedSkill, states: Int[Array, " T"], covariance_regularisation: float
) -> Reference:
    """The reference of a given state sequence, its targets moving evenly from those of now to those of later.

    now is the skill where the objects stand at the first step, later where they are expected at the last; in
    between they are taken to move evenly. Weights are those of now. Later quaternions have the sign that is
    nearer to those of now.
    Raises: InvalidInput, when the two differ in states or columns, or covariance_regularisation cannot be used.
    """
    for name, skill in (("now", now), ("later", later)):
        require_type(skill, name, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    if now.means.shape != later.means.shape:
        raise InvalidInput(
            f"the skills now and later have means of shape {now.means.shape} and {later.means.shape}, "
            "expected the same skill adapted twice"
        )
    if now.layout != later.layout:
        raise InvalidInput(
            f"the skills now and later have the columns {', '.join(now.layout.names)} and "
            f"{', '.join(later.layout.names)}, expected the same skill adapted twice"
        )
    initial_reference = reference_from_states(now, states, covariance_regularisation)
    means = later.means.copy()
    for columns in now.layout.quaternions:
        opposite = np.sum(means[:, columns] * now.means[:, columns], axis=1) < 0.0
        rates = _rate_columns(columns, now)
        means[opposite, columns] *= -1.0
        means[opposite, rates] *= -1.0
    fraction = np.linspace(0.0, 1.0, len(states))[:, None]
    return replace(
        initial_reference, targets=(1.0 - fraction) * initial_reference.targets + fraction * means[states]
    )


def _rate_columns(columns: slice, model: AdaptedSkill) -> slice:
    """The columns of the derivative of a quaternion; none where the layout has no speeds."""
    parts = list(zip(model.layout.parts, model.layout.slices, strict=True))
    name = next(part.name for part, part_columns in parts if part_columns == columns)
    found = [part_columns for part, part_columns in parts if (part.name, part.derivative) == (name, 1)]
    return found[0] if found else slice(0, 0)


def reproduce_step(
    skill: Skill,
    before: dict[str, Pose],
    now: dict[str, Pose],
    x: Float[Array, " D"],
    states: Int[Array, " T"],
    *,
    control_cost: float = CONTROL_COST,
    covariance_regularisation: float = COVARIANCE_REGULARISATION,
) -> Float[Array, " D"]:
    """Return the next state of a reproduction whose objects move.

    The objects are taken to move on with the velocity of their last period, and the coming steps are planned for
    where they are and where they will be.

    Args:
        skill: Learned skill.
        before: Pose of each object one period ago.
        now: Pose of each object.
        x: Current state of the robot, in the columns of the skill.
        states: States of the coming steps, this one first; the first periods of a plan_states result.
        control_cost: R, the cost of squared acceleration.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared].

    Returns:
        The state one period later.

    Raises:
        InvalidInput: If the frames or columns do not fit the skill.
    """
    adapted = adapt(skill, moving_frames(skill, before, now, x))
    last = len(states) - 1
    poses = [
        {name: extrapolate_pose(before[name], now[name], steps) for name in now} for steps in (last - 1, last)
    ]
    later = adapt(skill, moving_frames(skill, poses[0], poses[1], x))
    system = double_integrator(coordinates_with_derivatives(skill.layout), skill.period)
    if not skill.layout.orientation_starts:
        aligned = align_quaternion_signs(x, adapted)
        reference = moving_frame_reference(aligned, later, states, covariance_regularisation)
        return np.asarray(track(system, reference, control_cost).rollout(x).x[1])
    chart = tangent_chart(adapted)
    base = adapted.means[0].copy()
    for start, quaternion in zip(skill.layout.orientation_starts, chart.bases, strict=True):
        base[start : start + 4] = quaternion
    later = tangent_chart(later, base_pose=base).skill
    reference = moving_frame_reference(chart.skill, later, states, covariance_regularisation)
    motion = track(system, reference, control_cost).rollout(chart.to_tangent(x))
    return np.asarray(chart.to_manifold(motion.x[1]))


def moving_frames(
    skill: Skill, before: dict[str, Pose], now: dict[str, Pose], x: Float[Array, " D"]
) -> list[Frame]:
    """Return the frames of objects from two poses a period apart, with their velocities.

    Args:
        skill: Learned skill, whose columns the frames have.
        before: Pose of each object one period ago.
        now: Pose of each object.
        x: State of the robot; on S^3 the velocity of a rotating frame depends on it.
    """
    layout = Layout(tuple(part for part in skill.layout.parts if part.derivative == 0))
    next_poses = {name: extrapolate_pose(before[name], now[name], 1) for name in now}
    frames = [moving_frame_from_poses(name, layout, (now[name], next_poses[name])) for name in now]
    points = np.tile(x[: layout.width], (2, 1))
    for columns in layout.quaternions:  # a plan in R^n leaves the unit sphere a little
        points[:, columns] = normalise(points[:, columns])
    differentiate = add_derivatives(demonstration(points, skill.period, layout, frames)).frames
    return [frame.at(0) if isinstance(frame, MovingFrame) else frame for frame in differentiate]


def extrapolate_pose(before: Pose, now: Pose, steps: int) -> Pose:
    """Return the pose of an object after a number of periods, each of which moves it as the last did."""
    rotation = steps * rotation_vector_in_world(before.quaternion, now.quaternion)
    translation = steps * (now.position - before.position)
    return Pose(now.position + translation, multiply(from_rotation_vector(rotation), now.quaternion))
