"""Reproductions equal adapt, plan, track and rollout by hand, in R^n and on S^3."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import Demonstration, frame_from_pose, to_sphere
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, from_rotation_vector, multiply
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import Skill, adapt, learn
from pilotfish.planning import (
    default_control_cost,
    mean_demonstration_length,
    moving_frames,
    plan,
    plan_states,
    reproduce,
    reproduce_step,
    tangent_chart,
    via_point,
)
from pilotfish.planning.reproduction import coordinates_with_derivatives

HORIZON = 60
SITUATION = 5  # a test demonstration


@cache
def demonstrations(sphere: bool) -> tuple[Demonstration, ...]:
    demos = synthetic_valve(np.random.default_rng(0))
    return tuple(to_sphere(demo) for demo in demos) if sphere else demos


@cache
def learn_valve(sphere: bool) -> Skill:
    return learn(demonstrations(sphere)[:4], states=5, rng=np.random.default_rng(0)).skill


def track_by_hand(skill: Skill, reference, start, control_cost):
    axes = coordinates_with_derivatives(skill.layout)
    return track(double_integrator(axes, skill.period), reference, control_cost).rollout(start)


@pytest.mark.parametrize("with_start", [True, False])
@pytest.mark.parametrize("with_via_point", [True, False])
def test_reproduce_vector_space_equals_steps_by_hand(with_start: bool, with_via_point: bool):
    """In R^n: adapt, plan, track and rollout give the same motion."""
    skill, situation = learn_valve(False), demonstrations(False)[SITUATION]
    start = situation.x[0] if with_start else None
    points = [via_point("position", situation.x[30, :3], time=3.0, deviation=0.01)] if with_via_point else []
    adapted = adapt(skill, situation.frames)
    reference = plan(adapted, start, horizon=HORIZON, via_points=points)
    begin = adapted.endpoints.means[0] if start is None else start
    expected = track_by_hand(skill, reference, begin, default_control_cost(adapted))
    found = reproduce(skill, situation.frames, start, horizon=HORIZON, via_points=points)
    np.testing.assert_array_equal(found.motion.x, expected.x)
    np.testing.assert_array_equal(found.motion.u, expected.u)
    np.testing.assert_array_equal(found.targets, reference.targets)
    assert found.tangent_chart is None
    assert found.tangent_skill is found.adapted


@pytest.mark.parametrize("with_start", [True, False])
@pytest.mark.parametrize("sphere", [False, True])
def test_reproduce_published_plan_equals_steps_by_hand(with_start: bool, sphere: bool):
    """A stepwise plan has no end point, and begins at its first target."""
    skill, situation = learn_valve(sphere), demonstrations(sphere)[SITUATION]
    adapted = adapt(skill, situation.frames)
    chart = tangent_chart(adapted) if sphere else None
    start = situation.x[0] if with_start else None
    tangent_start = chart.to_tangent(start) if chart and with_start else start
    reference = plan(
        chart.skill if chart else adapted,
        tangent_start,
        horizon=HORIZON,
        covariance_regularisation=2e-3,
        stepwise=True,
    )
    begin = reference.targets[0] if tangent_start is None else tangent_start
    expected = track_by_hand(skill, reference, begin, 9.0)
    found = reproduce(
        skill,
        situation.frames,
        start,
        horizon=HORIZON,
        control_cost=9.0,
        covariance_regularisation=2e-3,
        stepwise=True,
    )
    np.testing.assert_array_equal(found.motion.x, chart.to_manifold(expected.x) if chart else expected.x)
    np.testing.assert_array_equal(found.motion.u, expected.u)


@pytest.mark.parametrize("with_start", [True, False])
@pytest.mark.parametrize("with_via_point", [True, False])
def test_reproduce_sphere_equals_steps_by_hand(with_start: bool, with_via_point: bool):
    """On S^3: plan and track in the tangent chart, then map the motion back."""
    skill, situation = learn_valve(True), demonstrations(True)[SITUATION]
    point = via_point("orientation", situation.x[30, 3:7], time=3.0, deviation=0.02)
    adapted = adapt(skill, situation.frames)
    chart = tangent_chart(adapted)
    start = chart.to_tangent(situation.x[0]) if with_start else None
    points = [chart.via_point(point)] if with_via_point else []
    reference = plan(chart.skill, start, horizon=HORIZON, via_points=points)
    begin = chart.skill.endpoints.means[0] if start is None else start
    expected = track_by_hand(skill, reference, begin, default_control_cost(chart.skill))
    found = reproduce(
        skill,
        situation.frames,
        situation.x[0] if with_start else None,
        horizon=HORIZON,
        via_points=[point] if with_via_point else [],
    )
    np.testing.assert_array_equal(found.motion.x, chart.to_manifold(expected.x))
    np.testing.assert_array_equal(found.motion.u, expected.u)
    np.testing.assert_array_equal(found.targets, chart.to_manifold(reference.targets))
    np.testing.assert_array_equal(found.tangent_skill.means, chart.skill.means)
    np.testing.assert_allclose(np.linalg.norm(found.motion.x[:, 3:7], axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("sphere", [False, True])
def test_reproduce_precise_via_point_is_passed(sphere: bool):
    """Position and orientation reach a precise via-point at its time."""
    skill, situation = learn_valve(sphere), demonstrations(sphere)[SITUATION]
    position, q = situation.x[30, :3] + 0.02, situation.x[30, 3:7]
    points = [
        via_point("position", position, time=3.0, deviation=1e-5),
        via_point("orientation", q, time=3.0, deviation=1e-4),
    ]
    x = reproduce(skill, situation.frames, situation.x[0], horizon=HORIZON, via_points=points).motion.x
    assert np.linalg.norm(x[30, :3] - position) < 1e-5
    assert angle(x[30, 3:7], q) < 3e-4  # three deviations


def test_reproduce_default_horizon_is_mean_demonstration_length():
    """Four demonstrations of 200 rows give 200 steps."""
    skill, situation = learn_valve(False), demonstrations(False)[SITUATION]
    assert mean_demonstration_length(skill) == 200
    assert len(reproduce(skill, situation.frames).motion.x) == 200
    unknown = replace(skill, provenance=replace(skill.provenance, demonstrations=()))
    with pytest.raises(InvalidInput, match="pass a horizon"):
        reproduce(unknown, situation.frames)


@pytest.mark.parametrize("sphere", [False, True])
def test_reproduce_unusable_start_is_refused(sphere: bool):
    """The start must be a finite point of the skill's layout."""
    skill, situation = learn_valve(sphere), demonstrations(sphere)[SITUATION]
    with pytest.raises(InvalidInput, match=r"start has shape \(3,\), expected"):
        reproduce(skill, situation.frames, np.zeros(3), horizon=HORIZON)
    start = situation.x[0].copy()
    start[0] = np.nan
    with pytest.raises(InvalidInput, match="not finite"):
        reproduce(skill, situation.frames, start, horizon=HORIZON)


def poses_of(demo: Demonstration) -> dict[str, Pose]:
    """Return poses whose frames are those of the demonstration."""
    return {frame.name: Pose(frame.b[:3], frame.A[3:7, 3]) for frame in demo.frames}


@pytest.mark.parametrize("sphere", [False, True])
def test_reproduce_step_static_objects_equals_plan_of_coming_states(sphere: bool):
    """Where nothing moves, a step is the first one of a plan for the same states."""
    skill, situation = learn_valve(sphere), demonstrations(sphere)[SITUATION]
    poses, x = poses_of(situation), situation.x[10]
    frames = [frame_from_pose(name, skill.layout, pose) for name, pose in poses.items()]
    adapted = adapt(skill, frames)
    chart = tangent_chart(adapted) if sphere else None
    start = chart.to_tangent(x) if chart else x
    aligned, states = plan_states(chart.skill if chart else adapted, start, horizon=30, complete=False)
    reference = plan(aligned, start, horizon=30, complete=False)
    expected = track_by_hand(skill, reference, start, default_control_cost(aligned)).x[1]
    found = reproduce_step(skill, poses, poses, x, states)
    np.testing.assert_allclose(found, chart.to_manifold(expected) if chart else expected, atol=1e-9)


@pytest.mark.parametrize("sphere", [False, True])
def test_reproduce_step_moving_objects_moves_with_them(sphere: bool):
    """Objects that translate together add their velocity: the step is shifted by their displacement."""
    skill, situation = learn_valve(sphere), demonstrations(sphere)[SITUATION]
    now, d = poses_of(situation), np.array([0.01, -0.004, 0.002])
    before = {name: Pose(pose.position - d, pose.quaternion) for name, pose in now.items()}
    states = np.repeat(np.arange(skill.states), 6)
    D, x = situation.layout.columns("position", 1), situation.x[10]
    moving = x.copy()
    moving[D] += d / skill.period
    static_step = reproduce_step(skill, now, now, x, states)
    moving_step = reproduce_step(skill, before, now, moving, states)
    expected = static_step.copy()
    expected[:3] += d
    expected[D] += d / skill.period
    np.testing.assert_allclose(moving_step, expected, atol=1e-9)


def test_moving_frames_translating_objects_have_pose_and_velocity():
    """The frame has the present pose, and the velocity of its origin as offset of the velocities."""
    skill, situation = learn_valve(False), demonstrations(False)[SITUATION]
    now = poses_of(situation)
    rotation = from_rotation_vector(np.array([0.0, 0.0, 0.05]))
    before = {
        name: Pose(pose.position - 0.01, multiply(rotation, pose.quaternion)) for name, pose in now.items()
    }
    frames = moving_frames(skill, before, now, situation.x[0])
    assert [frame.name for frame in frames] == list(now)
    for frame in frames:
        static = frame_from_pose(frame.name, skill.layout, now[frame.name])
        np.testing.assert_allclose(frame.A[:7, :7], static.A[:7, :7], atol=1e-12)
        np.testing.assert_allclose(frame.b[:7], static.b[:7], atol=1e-12)
        np.testing.assert_allclose(frame.b[7:10], 0.1, atol=1e-12)  # velocity 0.01 per period of 0.1 s
