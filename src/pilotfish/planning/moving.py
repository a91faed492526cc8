"""Reproduce a skill while the objects move: plan again each period with extrapolated frames.

The objects are assumed to move on as in their last period. The skill is adapted to the frames now and to
those expected at the last of the coming steps. Targets are interpolated between the two, with the weights of
now.
"""

from dataclasses import replace

import numpy as np

from pilotfish.control import Reference, double_integrator, track
from pilotfish.demonstrations import (
    Frame,
    Layout,
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
from pilotfish.planning.costs import default_control_cost
from pilotfish.planning.plan import reference_from_states
from pilotfish.planning.reproduction import coordinates_with_derivatives
from pilotfish.planning.tangent_chart import tangent_chart
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type


def reproduce_step(
    skill: Skill,
    previous_poses: dict[str, Pose],
    current_poses: dict[str, Pose],
    x: Float[Array, " D"],
    states: Int[Array, " T"],
    *,
    control_cost: float | None = None,
    covariance_regularisation: float | None = None,
) -> Float[Array, " D"]:
    """Return the next point x of a reproduction while the objects move.

    Args:
        skill: Learned skill.
        previous_poses: Pose of each object one period ago.
        current_poses: Pose of each object.
        x: Current state of the robot, in the columns of the skill.
        states: State of each coming step, beginning with this one: the first periods of a `plan_states`
            result.
        control_cost: R, the cost of squared acceleration; None derives it from the scales of the skill.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared]; None derives it from the scales of the skill.

    Returns:
        The state one period later.

    Raises:
        InvalidInput: If the frames or columns do not fit the skill.
    """
    adapted = adapt(skill, moving_frames(skill, previous_poses, current_poses, x))
    last = len(states) - 1
    previous, final = (
        {name: _extrapolate_pose(previous_poses[name], current_poses[name], steps) for name in current_poses}
        for steps in (last - 1, last)
    )
    later = adapt(skill, moving_frames(skill, previous, final, x))
    system = double_integrator(coordinates_with_derivatives(skill.layout), skill.period)
    if not skill.layout.orientations:
        aligned = align_quaternion_signs(x, adapted)
        reference = moving_frame_reference(aligned, later, states, covariance_regularisation)
        R = default_control_cost(aligned) if control_cost is None else control_cost
        return np.asarray(track(system, reference, R).rollout(x).x[1])
    chart = tangent_chart(adapted)
    base_pose = adapted.means[0].copy()
    for columns, quaternion in zip(skill.layout.orientations, chart.base_quaternions, strict=True):
        base_pose[columns.quaternion] = quaternion
    later_chart = tangent_chart(later, base_pose=base_pose)
    reference = moving_frame_reference(chart.skill, later_chart.skill, states, covariance_regularisation)
    R = default_control_cost(chart.skill) if control_cost is None else control_cost
    motion = track(system, reference, R).rollout(chart.to_tangent(x))
    return np.asarray(chart.to_manifold(motion.x[1]))


def moving_frames(
    skill: Skill, previous_poses: dict[str, Pose], current_poses: dict[str, Pose], x: Float[Array, " D"]
) -> list[Frame]:
    """Return the frames of objects, with their velocities, from two poses a period apart.

    Args:
        skill: Learned skill, whose columns the frames have.
        previous_poses: Pose of each object one period ago.
        current_poses: Pose of each object.
        x: State of the robot; on S^3 the velocity in a rotating frame depends on it.
    """
    layout = Layout(tuple(part for part in skill.layout.parts if part.derivative == 0))
    next_poses = {
        name: _extrapolate_pose(previous_poses[name], current_poses[name], 1) for name in current_poses
    }
    frames = [
        moving_frame_from_poses(name, layout, (current_poses[name], next_poses[name]))
        for name in current_poses
    ]
    points = np.tile(x[: layout.width], (2, 1))
    for columns in layout.quaternions:  # a plan in R^4 leaves the unit sphere slightly
        points[:, columns] = normalise(points[:, columns])
    recording = add_derivatives(demonstration(points, skill.period, layout, frames))
    return [frame.at(0) for frame in recording.frames]


def moving_frame_reference(
    now: AdaptedSkill,
    later: AdaptedSkill,
    states: Int[Array, " T"],
    covariance_regularisation: float | None = None,
) -> Reference:
    """Return the reference of a state sequence with targets interpolated from one adapted skill to another.

    Args:
        now: Skill adapted to the frames at the first step; its weights are used throughout.
        later: Skill adapted to the frames expected at the last step; its quaternions take the signs of now.
        states: State of each step.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared]; None derives it from the scales of the skill.

    Raises:
        InvalidInput: If the two differ in states or columns, or covariance_regularisation cannot be used.
    """
    for name, skill in (("now", now), ("later", later)):
        require_type(skill, name, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    if now.means.shape != later.means.shape:
        raise InvalidInput(
            f"now and later have means of shape {now.means.shape} and {later.means.shape}, expected the same "
            "skill adapted twice"
        )
    if now.layout != later.layout:
        raise InvalidInput(
            f"now and later have the columns {', '.join(now.layout.names)} and "
            f"{', '.join(later.layout.names)}, expected the same skill adapted twice"
        )
    reference = reference_from_states(now, states, covariance_regularisation)
    means = later.means.copy()
    for columns in now.layout.quaternions:
        opposite = np.sum(means[:, columns] * now.means[:, columns], axis=1) < 0.0
        means[opposite, columns] *= -1.0
        means[opposite, _rate_columns(columns, now.layout)] *= -1.0
    fraction = np.linspace(0.0, 1.0, len(states))[:, None]
    return replace(reference, targets=(1.0 - fraction) * reference.targets + fraction * means[states])


def _rate_columns(columns: slice, layout: Layout) -> slice:
    """Return the columns of the derivative of a quaternion; empty if there is none."""
    pairs = list(zip(layout.parts, layout.slices, strict=True))
    name = next(part.name for part, part_columns in pairs if part_columns == columns)
    found = [part_columns for part, part_columns in pairs if (part.name, part.derivative) == (name, 1)]
    return found[0] if found else slice(0, 0)


def _extrapolate_pose(before: Pose, now: Pose, steps: int) -> Pose:
    """Return the pose of an object after a number of periods, each of which moves it as the last one did."""
    rotation = steps * rotation_vector_in_world(before.quaternion, now.quaternion)
    translation = steps * (now.position - before.position)
    return Pose(now.position + translation, multiply(from_rotation_vector(rotation), now.quaternion))
