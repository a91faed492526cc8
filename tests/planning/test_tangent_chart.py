"""Tangent charts: maps, differential, planning, and invariance to transforms of the world."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import (
    Frame,
    Layout,
    Quantity,
    demonstration,
    frame_from_pose,
    pose_layout,
    to_sphere,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    Pose,
    angle,
    exp_map,
    from_rotation_vector,
    log_map,
    multiply,
    normalise,
    quaternion_exp,
    relative_rotation_vector,
    rotation_matrix,
)
from pilotfish.io import datasets
from pilotfish.models import AdaptedSkill, SemiMarkovChain, adapt, learn
from pilotfish.models.durations import Gaussian as GaussianDurations
from pilotfish.planning import plan, plan_states, tangent_chart
from pilotfish.planning.plan import reference_from_states

POSE = pose_layout()
SPHERE = Layout((POSE.parts[0], replace(POSE.parts[1], quantity=Quantity.ORIENTATION)))
MOVING = SPHERE.differentiate()
STARTS = (3,)


def random_skill(rng, orientations, speeds=None):
    K = len(orientations)
    A = rng.normal(size=(K, 12, 12))
    speeds = rng.normal(size=(K, 3)) if speeds is None else speeds
    means = np.hstack([rng.normal(size=(K, 3)), orientations, 0.1 * rng.normal(size=(K, 3)), speeds])
    durations = GaussianDurations(np.full(K, 12.0), np.ones(K))
    dynamics = SemiMarkovChain(np.eye(K)[0], np.eye(K, k=1), durations)
    return AdaptedSkill(dynamics, means, 1e-3 * (A @ A.transpose(0, 2, 1) + np.eye(12)), MOVING, 0.1)


@pytest.fixture
def model(rng):
    """Return three states about a radian apart, with velocities and random quaternion signs."""
    q = multiply(
        normalise(rng.normal(size=4)), from_rotation_vector(np.cumsum(rng.normal(size=(3, 3)), axis=0))
    )
    return random_skill(rng, rng.choice([-1.0, 1.0], size=(3, 1)) * q)


def test_to_manifold_inverts_to_tangent(rng, model):
    """Poses and angular velocities are recovered, for one or several points and either sign."""
    chart = tangent_chart(model)
    x = exp_map(model.means[np.arange(30) % 3], 0.3 * rng.normal(size=(30, 12)), STARTS)
    for points in (x, x[4], x.reshape(5, 6, 13)):
        recovered = chart.to_manifold(chart.to_tangent(points))
        assert recovered.shape == points.shape
        np.testing.assert_allclose(log_map(points, recovered, STARTS), 0.0, atol=1e-12)
    np.testing.assert_allclose(
        chart.to_tangent(x * np.repeat([1, -1, 1], [3, 4, 6])), chart.to_tangent(x), atol=1e-12
    )


def test_to_tangent_rates_are_derivatives_of_rotation_vectors(rng, model):
    """A small step along the rate rotates the body by its angular velocity times the step."""
    chart, h = tangent_chart(model), 1e-6
    x = exp_map(model.means[1], 0.3 * rng.normal(size=12), STARTS)
    y = chart.to_tangent(x)
    step = np.concatenate([np.zeros(3), h * y[9:], np.zeros(6)])
    before, after = chart.to_manifold(y - step), chart.to_manifold(y + step)
    np.testing.assert_allclose(relative_rotation_vector(before[3:7], after[3:7]) / (2 * h), x[10:], atol=1e-6)


@pytest.mark.parametrize("base", ["middle", "start"])
def test_tangent_chart_covariance_equals_central_differences(rng, model, base):
    """Central differences of to_tangent about every mean, with the coupling of rotations and rates."""
    chart = tangent_chart(model, base_pose=None if base == "middle" else model.means[0])
    step = 1e-6
    for k in range(3):
        np.testing.assert_allclose(chart.to_tangent(model.means[k]), chart.skill.means[k], atol=1e-12)
        M = np.stack(
            [
                chart.to_tangent(exp_map(model.means[k], step * e, STARTS))
                - chart.to_tangent(exp_map(model.means[k], -step * e, STARTS))
                for e in np.eye(12)
            ],
            axis=1,
        ) / (2 * step)
        expected = M @ model.covariances[k] @ M.T
        np.testing.assert_allclose(chart.skill.covariances[k], expected, atol=1e-7)


def test_tangent_chart_at_base_keeps_covariance(rng):
    """A skill of one state at rest keeps its covariance."""
    model = random_skill(rng, normalise(rng.normal(size=(1, 4))), np.zeros((1, 3)))
    np.testing.assert_allclose(tangent_chart(model).skill.covariances, model.covariances, atol=1e-12)


def test_plan_in_chart_transformed_world_transforms_motion(rng, model):
    """A transformed world gives the transformed motion, for either sign of the start."""
    world, shift = normalise(rng.normal(size=4)), rng.normal(size=3)
    R = rotation_matrix(world)

    def transform(x):
        q = multiply(world, x[..., 3:7]) * rng.choice([-1.0, 1.0])
        parts = [x[..., :3] @ R.T + shift, q, x[..., 7:10] @ R.T, x[..., 10:]]
        return np.concatenate(parts, axis=-1)

    def motion(skill, start):
        chart = tangent_chart(skill)
        targets = plan(chart.skill, chart.to_tangent(start), horizon=40)
        motion = track(double_integrator(6, 0.1), targets, 1.0).rollout(chart.to_tangent(start))
        return chart.to_manifold(motion.x)

    A = np.eye(12)
    A[:3, :3] = A[6:9, 6:9] = R
    transformed = replace(model, means=transform(model.means), covariances=A @ model.covariances @ A.T)
    start = exp_map(model.means[0], 0.1 * rng.normal(size=12), STARTS)
    original, found = motion(model, start), motion(transformed, transform(start))
    np.testing.assert_allclose(log_map(transform(original), found, STARTS), 0.0, atol=1e-6)


def test_plan_in_chart_reaches_last_orientation(rng):
    model = random_skill(
        rng, quaternion_exp(np.array([[0.0, 0, 0], [0.3, 0.2, 0], [0.6, 0.2, 0.3]])), np.zeros((3, 3))
    )
    model = replace(model, covariances=1e-3 * np.tile(np.eye(12), (3, 1, 1)))
    chart = tangent_chart(model, base_pose=model.means[0])
    start = chart.to_tangent(model.means[0])
    reference = plan(chart.skill, start, horizon=120, stepwise=True)  # the last state lasts 96 steps
    motion = track(double_integrator(6, 0.1), reference, 1e-3).rollout(start)
    assert angle(chart.to_manifold(motion.x)[-1, 3:7], model.means[2, 3:7]) < 0.01


def test_tangent_chart_more_than_half_a_turn_is_continuous(rng):
    """Five states 60 degrees apart: the chart follows the full way round."""
    steps = np.radians(60.0) * np.arange(5)
    model = random_skill(
        rng, from_rotation_vector(steps[:, None] * np.array([0.0, 0.0, 1.0])), np.zeros((5, 3))
    )
    for chart in (tangent_chart(model), tangent_chart(model, base_pose=model.means[0])):
        np.testing.assert_allclose(np.diff(chart.skill.means[:, 5]), np.radians(60.0), atol=1e-9)
        np.testing.assert_allclose(chart.to_tangent(model.means), chart.skill.means, atol=1e-9)


def test_tangent_chart_without_velocities_equals_first_columns(rng, model):
    without_velocities = replace(
        model, means=model.means[:, :7], covariances=model.covariances[:, :6, :6], layout=SPHERE
    )
    tangent_skill = tangent_chart(without_velocities).skill
    np.testing.assert_allclose(tangent_skill.means, tangent_chart(model).skill.means[:, :6])
    np.testing.assert_allclose(tangent_skill.covariances, tangent_chart(model).skill.covariances[:, :6, :6])
    assert plan(tangent_skill, horizon=9).targets.shape == (9, 6)


def test_plan_orientations_on_sphere_are_refused(model):
    start = model.means[0]
    for attempt in (
        lambda: plan(model, start, horizon=9),
        lambda: plan(model, horizon=9),
        lambda: reference_from_states(model, np.array([0]), 1e-3),
    ):
        with pytest.raises(InvalidInput, match=r"pf\.reproduce"):
            attempt()
    assert plan_states(model, start, horizon=9)[1][0] == 0


def test_tangent_chart_unusable_argument_is_refused(rng, model):
    with pytest.raises(InvalidInput, match="plan it without a chart"):
        tangent_chart(tangent_chart(model).skill)
    with pytest.raises(InvalidInput, match="13 finite numbers"):
        tangent_chart(model, base_pose=np.zeros(7))


def valve_demonstrations(rng=None, world=None):
    """Return the valve's recordings on S^3 with random signs, in a transformed world."""
    demonstrations = []
    for demo in map(to_sphere, datasets.valve()):
        move = frame_from_pose("world", demo.layout, world) if world else world_frame(demo.layout.width)
        x, frames = demo.x @ move.A.T + move.b, []
        for frame in demo.frames:
            A = move.A @ frame.A
            A[3:7] *= -1.0 if rng is not None and rng.uniform() < 0.5 else 1.0
            frames.append(Frame(frame.name, A, move.A @ frame.b + move.b))
        if rng is not None:
            x[:, 3:7] *= rng.choice([-1.0, 1.0], size=(len(x), 1))
        demonstrations.append(demonstration(x, demo.period, demo.layout, frames, demo.name))
    return demonstrations


def learn_and_reproduce(demos, test):
    fit = learn(demos[:4], states=7, rng=np.random.default_rng(0))
    chart = tangent_chart(adapt(fit.skill, demos[test].frames))
    start = chart.to_tangent(demos[test].x[0])
    feedback = track(double_integrator(6, 0.1), plan(chart.skill, start, horizon=200), 9.0)
    return fit, chart.to_manifold(feedback.rollout(start).x)


def test_reproduce_valve_signs_and_world_transform_motion(data_folder, rng):
    """Random signs and a transformed world give the same likelihoods and the transformed motion."""
    world = Pose(rng.normal(size=3), quaternion_exp(rng.normal(size=3)))
    fit, motion = learn_and_reproduce(valve_demonstrations(), 5)
    same_fit, transformed = learn_and_reproduce(valve_demonstrations(rng, world), 5)
    np.testing.assert_allclose(same_fit.log_likelihoods, fit.log_likelihoods, rtol=1e-7)
    move = frame_from_pose("world", SPHERE.differentiate(), world)
    difference = log_map(motion @ move.A.T + move.b, transformed, STARTS)
    np.testing.assert_allclose(difference, 0.0, atol=1e-5)
