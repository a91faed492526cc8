"""Via-points in plans: they choose states, and are converted to tangent charts."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import Layout, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle, from_rotation_vector, multiply
from pilotfish.models import AdaptedSkill, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.durations import Gaussian as GaussianDurations
from pilotfish.planning import (
    condition_on,
    plan,
    tangent_chart,
    via_point,
)

PERIOD, STEPS = 0.1, 12
LAYOUT = position_layout(axes=2).differentiate()
CONTROL_COST = 0.3
START = np.array([0.1, -0.2, 0.0, 0.3])


def branching_skill(noise=1e-3):
    """Return a skill from the origin over the left (state 1) or the right (state 2) to a goal (3)."""
    chain = SemiMarkovChain(
        np.array([1.0, 0.0, 0.0, 0.0]),
        np.array([[0.0, 0.7, 0.3, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], np.zeros(4)]),
        GaussianDurations(np.full(4, 8.0), np.full(4, 1.5)),
    )
    means = np.zeros((4, 4))
    means[1, :2], means[2, :2], means[3, :2] = [-1.0, 1.0], [1.0, 1.0], [0.0, 2.0]
    return AdaptedSkill(chain, means, np.tile(noise * np.eye(4), (4, 1, 1)), LAYOUT, PERIOD)


def test_plan_via_point_on_rare_branch_selects_it():
    """Conditioning alone would leave the common way for the via-point and return to it."""
    model, start = branching_skill(), np.zeros(4)
    point = via_point("position x", 0.8, time=1.2, deviation=0.1)
    expected = plan(model, start, horizon=30)
    assert expected.targets[:, 0].min() == -1.0
    chosen = plan(model, start, horizon=30, via_points=[point])
    assert chosen.targets[:, 0].min() == 0.0
    np.testing.assert_allclose(np.delete(chosen.targets, 12, axis=0).max(axis=0)[:2], [1.0, 2.0])
    assert condition_on(expected, [point], LAYOUT).targets[:, 0].min() == -1.0


def test_plan_via_point_shifts_time_of_state():
    """A state is active at the time of a via-point near its mean, if its durations allow it.

    The plan is stepwise: a complete one stretches every state over the horizon.
    """
    model, start = branching_skill(), np.zeros(4)
    for time in (1.3, 2.1):
        point = via_point("position", [0.0, 2.0], time=time, deviation=0.05)
        states = plan(model, start, horizon=40, stepwise=True, via_points=[point]).targets[:, 1]
        first = np.flatnonzero(states == 2.0)[0]
        assert first <= round(time / PERIOD)
    late = via_point("position", [-1.0, 1.0], time=1.9, deviation=0.05)
    assert plan(model, start, horizon=40, stepwise=True).targets[19, 1] == 2.0
    assert plan(model, start, horizon=40, stepwise=True, via_points=[late]).targets[19, 1] == pytest.approx(
        1.0
    )


def test_plan_empty_via_points_equals_plan_without(rng):
    model = branching_skill()
    for start in (np.zeros(4), model.means[2], rng.normal(size=4)):
        expected, found = plan(model, start, horizon=30), plan(model, start, horizon=30, via_points=[])
        np.testing.assert_array_equal(found.targets, expected.targets)
        np.testing.assert_array_equal(found.weights, expected.weights)


def enumerate_posteriors(model, start, value, deviation, step):
    """Return p(state | start, via-point) at five steps of a Markov skill, by enumeration."""
    chain, S, K, total = model.dynamics, model.covariances, model.states, np.zeros((5, model.states))
    begins = [multivariate_normal(model.means[k], S[k]).pdf(start) for k in range(K)]
    noise = np.diag(deviation**2)
    passes = [multivariate_normal(model.means[k, :2], S[k][:2, :2] + noise).pdf(value) for k in range(K)]
    for path in itertools.product(range(K), repeat=5):
        p = chain.initial[path[0]] * np.prod([chain.transitions[i, j] for i, j in itertools.pairwise(path)])
        total[np.arange(5), path] += p * begins[path[0]] * passes[path[step]]
    return total / total.sum(axis=1, keepdims=True)


def test_plan_via_point_states_equal_enumeration(rng):
    """Compare with enumeration of every state sequence of short Markov skills."""
    K, step = 3, 3
    for _ in range(30):
        A = rng.normal(size=(K, 4, 4))
        chain = MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K))
        covariances = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(4)
        model = AdaptedSkill(chain, rng.normal(size=(K, 4)), covariances, LAYOUT, PERIOD)
        start, value, deviation = rng.normal(size=4), 2.0 * rng.normal(size=2), rng.uniform(0.1, 3.0, size=2)
        states = enumerate_posteriors(model, start, value, deviation, step).argmax(axis=1)
        point = via_point("position", value, time=step * PERIOD, deviation=deviation)
        targets = plan(model, start, horizon=5, via_points=[point]).targets
        others = [0, 1, 2, 4]
        np.testing.assert_array_equal(targets[others], model.means[states][others])


def test_plan_negated_start_negates_targets(rng):
    """The plan is negated with the start; the via-point may have either sign."""
    layout, rest = pose_layout(), rng.normal(size=(2, 7))
    rest[:, 3:] /= np.linalg.norm(rest[:, 3:], axis=1, keepdims=True)
    chain = SemiMarkovChain(np.eye(2)[0], np.eye(2, k=1), GaussianDurations(np.full(2, 5.0), np.ones(2)))
    model = AdaptedSkill(chain, rest, np.tile(1e-2 * np.eye(7), (2, 1, 1)), layout, PERIOD)
    points = [via_point("orientation", rest[0, 3:], time=0.7, deviation=0.1)]
    signs = np.repeat([1.0, -1.0], [3, 4])
    expected = plan(model, rest[0], horizon=12, via_points=points).targets
    found = plan(model, signs * rest[0], horizon=12, via_points=points).targets
    np.testing.assert_allclose(found, signs * expected, atol=1e-12)


def test_plan_mixture_or_unusable_start_is_refused():
    model = branching_skill()
    with pytest.raises(InvalidInput, match="no order in time"):
        plan(replace(model, dynamics=MixtureWeights(np.full(4, 0.25))), np.zeros(4), horizon=9)
    with pytest.raises(InvalidInput, match="not finite"):
        plan(model, np.full(4, np.nan), horizon=9)
    point = via_point("position x", 0.0, time=0.9, deviation=1.0)
    with pytest.raises(InvalidInput, match=r"0\.1 to 0\.8 s"):
        plan(model, np.zeros(4), horizon=9, via_points=[point])


@pytest.fixture
def sphere_skill(rng):
    """Return a skill of poses on S^3 with three states about a radian apart."""
    q = from_rotation_vector(np.cumsum(rng.normal(size=(3, 3)), axis=0))
    layout = to_sphere_layout(pose_layout()).differentiate()
    means = np.hstack([rng.normal(size=(3, 3)), q, np.zeros((3, 6))])
    chain = SemiMarkovChain(np.eye(3)[0], np.eye(3, k=1), GaussianDurations(np.full(3, 8.0), np.ones(3)))
    return AdaptedSkill(chain, means, np.tile(1e-2 * np.eye(12), (3, 1, 1)), layout, PERIOD)


def to_sphere_layout(layout):
    return Layout((layout.parts[0], replace(layout.parts[1], quantity=Quantity.ORIENTATION)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_chart_via_point_orientation_is_passed(rng, sphere_skill, sign):
    """Given as q or -q, near the way or half a radian off it, the orientation is reached."""
    chart, start = tangent_chart(sphere_skill), sphere_skill.means[0]
    q = multiply(sphere_skill.means[1, 3:7], from_rotation_vector(0.5 * rng.normal(size=3)))
    position = sphere_skill.means[1, :3] + 0.1
    time = 1.2
    points = [
        chart.via_point(via_point("orientation", sign * q, time=time, deviation=1e-4)),
        chart.via_point(via_point("position", position, time=time, deviation=1e-4)),
        chart.via_point(via_point("orientation'", np.zeros(3), time=time, deviation=1e-4)),
    ]
    robot = double_integrator(6, PERIOD)
    for conditioned in (
        condition_on(plan(chart.skill, chart.to_tangent(start), horizon=25), points, chart.skill.layout),
        plan(chart.skill, chart.to_tangent(start), horizon=25, via_points=points),
    ):
        x = chart.to_manifold(track(robot, conditioned, 0.1).rollout(chart.to_tangent(start)).x)
        assert angle(x[12, 3:7], q) < 1e-4
        assert np.linalg.norm(x[12, :3] - position) < 1e-4
        assert np.linalg.norm(x[12, 10:]) < 1e-3
        assert np.max(angle(x[1:, 3:7], x[:-1, 3:7])) < 1.0


def test_chart_via_point_deviation_at_base_is_angle(sphere_skill):
    """At the base the deviation in the chart is the angle, about every axis."""
    base = tangent_chart(sphere_skill).base_quaternions[0]
    chart = tangent_chart(sphere_skill, base_pose=np.concatenate([np.zeros(3), base, np.zeros(6)]))
    point = chart.via_point(via_point("orientation", base, time=0.5, deviation=0.02))
    np.testing.assert_allclose(point.value, 0.0, atol=1e-12)
    np.testing.assert_array_equal(point.deviation, np.full(3, 0.02))


def test_chart_via_point_unusable_point_is_refused(sphere_skill):
    chart, q = tangent_chart(sphere_skill), sphere_skill.means[0, 3:7]
    with pytest.raises(InvalidInput, match="norm 2"):
        chart.via_point(via_point("orientation", 2.0 * q, time=1.0, deviation=0.1))
    for name, value, deviation in (
        ("orientation", q[:3], 0.1),
        ("orientation w", 1.0, 0.1),
        ("orientation", q, [0.1, 0.1, 0.1, 0.2]),
    ):
        with pytest.raises(InvalidInput, match="whole unit quaternion"):
            chart.via_point(via_point(name, value, time=1.0, deviation=deviation))
    reference = plan(chart.skill, chart.skill.means[0], horizon=9)
    point = via_point("orientation", q, time=0.5, deviation=0.1)
    with pytest.raises(InvalidInput, match=r"4 numbers, expected 3.*TangentChart.via_point"):
        condition_on(reference, [point], chart.skill.layout)
    with pytest.raises(InvalidInput, match="expected 0"):
        chart.via_point(via_point("orientation'", [0.0, 1.0, 0.0], time=1.0, deviation=0.1))
