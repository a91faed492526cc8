"""A flat map of a curved skill: nothing is lost on it, and what is planned there is a movement of bodies."""

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
from pilotfish.models import AdaptedSkill, GaussianDurations, SemiMarkovChain, adapt, learn
from pilotfish.planning import expected_plan, plan, planned_states, reference_from_states, tangent_chart

POSE = pose_layout()
SPHERE = Layout((POSE.parts[0], replace(POSE.parts[1], quantity=Quantity.ORIENTATION)))
MOVING = SPHERE.differentiate()
TURNS = (3,)


def skill_of(rng, orientations, speeds=None):
    K = len(orientations)
    A = rng.normal(size=(K, 12, 12))
    speeds = rng.normal(size=(K, 3)) if speeds is None else speeds
    means = np.hstack([rng.normal(size=(K, 3)), orientations, 0.1 * rng.normal(size=(K, 3)), speeds])
    durations = GaussianDurations(np.full(K, 12.0), np.ones(K))
    dynamics = SemiMarkovChain(np.eye(K)[0], np.eye(K, k=1), durations)
    return AdaptedSkill(dynamics, means, 1e-3 * (A @ A.transpose(0, 2, 1) + np.eye(12)), MOVING, 0.1)


@pytest.fixture
def model(rng):
    """Three states that turn by about a radian each, with speeds, told by q or -q."""
    q = multiply(
        normalise(rng.normal(size=4)), from_rotation_vector(np.cumsum(rng.normal(size=(3, 3)), axis=0))
    )
    return skill_of(rng, rng.choice([-1.0, 1.0], size=(3, 1)) * q)


def test_outward_undoes_inward(rng, model):
    """Poses and angular velocities come back, of one point, of several, and with either sign."""
    here = tangent_chart(model)
    x = exp_map(model.means[np.arange(30) % 3], 0.3 * rng.normal(size=(30, 12)), TURNS)
    for points in (x, x[4], x.reshape(5, 6, 13)):
        back = here.to_manifold(here.to_tangent(points))
        assert back.shape == points.shape
        np.testing.assert_allclose(log_map(points, back, TURNS), 0.0, atol=1e-12)
    np.testing.assert_allclose(
        here.to_tangent(x * np.repeat([1, -1, 1], [3, 4, 6])), here.to_tangent(x), atol=1e-12
    )


def test_rates_on_the_map_are_how_its_vectors_change(rng, model):
    """Following the rate for a moment turns the body by its angular velocity times that moment."""
    here, h = tangent_chart(model), 1e-6
    x = exp_map(model.means[1], 0.3 * rng.normal(size=12), TURNS)
    y = here.to_tangent(x)
    step = np.concatenate([np.zeros(3), h * y[9:], np.zeros(6)])
    before, after = here.to_manifold(y - step), here.to_manifold(y + step)
    np.testing.assert_allclose(relative_rotation_vector(before[3:7], after[3:7]) / (2 * h), x[10:], atol=1e-6)


@pytest.mark.parametrize("base", ["middle", "start"])
def test_the_flat_covariance_is_that_of_the_map_of_small_deviations(rng, model, base):
    """Central differences of inward about every mean, speeds included: their coupling to turns too."""
    here = tangent_chart(model, base_pose=None if base == "middle" else model.means[0])
    step = 1e-6
    for k in range(3):
        np.testing.assert_allclose(here.to_tangent(model.means[k]), here.skill.means[k], atol=1e-12)
        M = np.stack(
            [
                here.to_tangent(exp_map(model.means[k], step * e, TURNS))
                - here.to_tangent(exp_map(model.means[k], -step * e, TURNS))
                for e in np.eye(12)
            ],
            axis=1,
        ) / (2 * step)
        expected = M @ model.covariances[k] @ M.T
        np.testing.assert_allclose(here.skill.covariances[k], expected, atol=1e-7)


def test_at_the_base_the_map_is_the_tangent_space(rng):
    """A skill of one state keeps its covariance but for what its own speed adds; at rest, all of it."""
    model = skill_of(rng, normalise(rng.normal(size=(1, 4))), np.zeros((1, 3)))
    np.testing.assert_allclose(tangent_chart(model).skill.covariances, model.covariances, atol=1e-12)


def test_a_plan_on_the_map_turns_along_with_the_world(rng, model):
    """The same movement, seen from elsewhere, whatever signs the start is told by."""
    world, shift = normalise(rng.normal(size=4)), rng.normal(size=3)
    R = rotation_matrix(world)

    def moved(x):
        q = multiply(world, x[..., 3:7]) * rng.choice([-1.0, 1.0])
        parts = [x[..., :3] @ R.T + shift, q, x[..., 7:10] @ R.T, x[..., 10:]]
        return np.concatenate(parts, axis=-1)

    def motion(skill, start):
        here = tangent_chart(skill)
        targets = plan(here.skill, here.to_tangent(start), horizon=40)
        done = track(double_integrator(6, 0.1), targets, 1.0).rollout(here.to_tangent(start))
        return here.to_manifold(done.x)

    carry = np.eye(12)
    carry[:3, :3] = carry[6:9, 6:9] = R
    there = replace(model, means=moved(model.means), covariances=carry @ model.covariances @ carry.T)
    start = exp_map(model.means[0], 0.1 * rng.normal(size=12), TURNS)
    one, other = motion(model, start), motion(there, moved(start))
    np.testing.assert_allclose(log_map(moved(one), other, TURNS), 0.0, atol=1e-6)


def test_a_movement_reaches_the_orientation_of_its_last_state(rng):
    model = skill_of(
        rng, quaternion_exp(np.array([[0.0, 0, 0], [0.3, 0.2, 0], [0.6, 0.2, 0.3]])), np.zeros((3, 3))
    )
    model = replace(model, covariances=1e-3 * np.tile(np.eye(12), (3, 1, 1)))
    here = tangent_chart(model, base_pose=model.means[0])
    start = here.to_tangent(model.means[0])
    done = track(double_integrator(6, 0.1), plan(here.skill, start, horizon=120), 1e-3).rollout(start)
    assert angle(here.to_manifold(done.x)[-1, 3:7], model.means[2, 3:7]) < 0.01


def test_a_skill_may_turn_by_more_than_half_a_turn(rng):
    """Five states of 60 degrees each: the map follows the way round, not the short way back."""
    steps = np.radians(60.0) * np.arange(5)
    model = skill_of(rng, from_rotation_vector(steps[:, None] * np.array([0.0, 0.0, 1.0])), np.zeros((5, 3)))
    for here in (tangent_chart(model), tangent_chart(model, base_pose=model.means[0])):
        np.testing.assert_allclose(np.diff(here.skill.means[:, 5]), np.radians(60.0), atol=1e-9)
        np.testing.assert_allclose(here.to_tangent(model.means), here.skill.means, atol=1e-9)


def test_a_chart_of_poses_without_speeds(rng, model):
    still = replace(model, means=model.means[:, :7], covariances=model.covariances[:, :6, :6], layout=SPHERE)
    flat = tangent_chart(still).skill
    np.testing.assert_allclose(flat.means, tangent_chart(model).skill.means[:, :6])
    np.testing.assert_allclose(flat.covariances, tangent_chart(model).skill.covariances[:, :6, :6])
    assert expected_plan(flat, horizon=9).targets.shape == (9, 6)


def test_curved_skills_are_not_planned_as_if_they_were_flat(model):
    start = model.means[0]
    for attempt in (
        lambda: plan(model, start, horizon=9),
        lambda: expected_plan(model, horizon=9),
        lambda: reference_from_states(model, np.array([0]), 1e-3),
    ):
        with pytest.raises(InvalidInput, match=r"pf\.chart"):
            attempt()
    assert planned_states(model, start, horizon=9)[0] == 0


def test_what_has_no_chart_is_refused(rng, model):
    with pytest.raises(InvalidInput, match="flat already"):
        tangent_chart(tangent_chart(model).skill)
    with pytest.raises(InvalidInput, match="13 finite numbers"):
        tangent_chart(model, base_pose=np.zeros(7))


def opened_valves(rng=None, world=None):
    """The valve's recording on S^3; rows and frames told by q or -q at random, by an observer elsewhere."""
    told = []
    for demo in map(to_sphere, datasets.valve()):
        move = frame_from_pose("world", demo.layout, world) if world else world_frame(demo.layout.width)
        x, frames = demo.x @ move.A.T + move.b, []
        for frame in demo.frames:
            A = move.A @ frame.A
            A[3:7] *= -1.0 if rng is not None and rng.uniform() < 0.5 else 1.0
            frames.append(Frame(frame.name, A, move.A @ frame.b + move.b))
        if rng is not None:
            x[:, 3:7] *= rng.choice([-1.0, 1.0], size=(len(x), 1))
        told.append(demonstration(x, demo.period, demo.layout, frames, demo.name))
    return told


def replayed(demos, test):
    fit = learn(demos[:4], states=7, rng=np.random.default_rng(0))
    here = tangent_chart(adapt(fit.skill, demos[test].frames))
    start = here.to_tangent(demos[test].x[0])
    feedback = track(double_integrator(6, 0.1), plan(here.skill, start, horizon=200), 9.0)
    return fit, here.to_manifold(feedback.rollout(start).x)


def test_a_valve_is_opened_alike_whatever_the_signs_and_the_worlds_axes(data_folder, rng):
    """From real recordings to the motion: the same trace, and a replay that turns along with the world."""
    world = Pose(rng.normal(size=3), quaternion_exp(rng.normal(size=3)))
    fit, motion = replayed(opened_valves(), 5)
    again, elsewhere = replayed(opened_valves(rng, world), 5)
    np.testing.assert_allclose(again.trace, fit.trace, rtol=1e-7)
    move = frame_from_pose("world", SPHERE.differentiate(), world)
    apart = log_map(motion @ move.A.T + move.b, elsewhere, TURNS)
    np.testing.assert_allclose(apart, 0.0, atol=1e-5)
