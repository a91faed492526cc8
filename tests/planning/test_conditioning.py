"""A plan drawn through points is the distribution of its motions, conditioned on measuring these points."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.control import Reference, double_integrator, solve_batch, track
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle, from_rotation_vector, multiply
from pilotfish.models import AdaptedSkill, GaussianDurations, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.planning import (
    ViaPoint,
    condition_on,
    plan,
    plan_through,
    tangent_chart,
    via_point,
    via_point_to_tangent,
)

PERIOD, STEPS = 0.1, 12
LAYOUT = position_layout(axes=2).differentiate()
CONTROL_COST = 0.3
START = np.array([0.1, -0.2, 0.0, 0.3])


def random_plan(rng, steps=STEPS, width=4):
    root = rng.normal(size=(steps, width, width))
    weights = root @ root.transpose(0, 2, 1) + 0.1 * np.eye(width)
    return Reference(rng.normal(size=(steps, width)), weights, PERIOD)


def joint_distribution(plan):
    """Mean and covariance of all states at once, of density exp(-cost / 2), from its definition."""
    system, T, n = double_integrator(2, PERIOD), len(plan.targets), 4
    forced, free = np.zeros((T, n, (T - 1) * 2)), [np.eye(n)]
    for t in range(T - 1):
        free.append(system.A @ free[-1])
        forced[t + 1] = system.A @ forced[t]
        forced[t + 1, :, 2 * t : 2 * t + 2] += system.B
    hessian = np.einsum("tia,tij,tjb->ab", forced, plan.weights, forced) + CONTROL_COST * np.eye(2 * T - 2)
    errors = plan.targets - np.array(free) @ START
    u = np.linalg.solve(hessian, np.einsum("tia,tij,tj->a", forced, plan.weights, errors))
    flat = forced.reshape(T * n, -1)
    mean = (np.array(free) @ START).ravel() + flat @ u
    return mean, flat @ np.linalg.solve(hessian, flat.T)


def conditioned(mean, covariance, places, values, deviations):
    """The Gaussian given measurements of some of its entries with independent noise."""
    seen = covariance[np.ix_(places, places)] + np.diag(np.square(deviations))
    gain = np.linalg.solve(seen, covariance[places]).T
    return mean + gain @ (values - mean[places]), covariance - gain @ covariance[places]


def tracked(plan):
    return track(double_integrator(2, PERIOD), plan, CONTROL_COST).rollout(START).x


def test_tracking_gives_the_trajectory_distribution_conditioned_on_the_points(rng):
    """One big Gaussian over all steps, conditioned by the textbook, against a plan with other targets."""
    plan = random_plan(rng)
    points = [
        via_point("position", [0.5, -0.4], time=0.5, deviation=0.01),
        via_point("position y", 0.9, time=0.8, deviation=0.2),
        via_point("position'", [0.0, 1.0], time=0.8, deviation=[0.1, 1e-3]),
    ]
    places = [5 * 4, 5 * 4 + 1, 8 * 4 + 1, 8 * 4 + 2, 8 * 4 + 3]
    values, deviations = np.array([0.5, -0.4, 0.9, 0.0, 1.0]), np.array([0.01, 0.01, 0.2, 0.1, 1e-3])
    mean, covariance = conditioned(*joint_distribution(plan), places, values, deviations)
    drawn = condition_on(plan, points, LAYOUT)
    np.testing.assert_allclose(tracked(drawn), mean.reshape(STEPS, 4), atol=1e-8)
    spread = solve_batch(double_integrator(2, PERIOD), drawn, CONTROL_COST, START).covariances
    for t in range(STEPS):
        block = covariance[4 * t : 4 * t + 4, 4 * t : 4 * t + 4]
        np.testing.assert_allclose(spread[t], block, atol=1e-8)


def test_a_plan_without_points_is_left_as_it_is(rng):
    plan = random_plan(rng)
    drawn = condition_on(plan, [], LAYOUT)
    np.testing.assert_array_equal(drawn.targets, plan.targets)
    np.testing.assert_array_equal(drawn.weights, plan.weights)
    assert drawn.period == plan.period


def test_only_the_steps_of_points_change_and_the_plan_given_stays(rng):
    plan = random_plan(rng)
    kept = plan.targets.copy(), plan.weights.copy()
    drawn = condition_on(plan, [via_point("position", [1.0, 1.0], time=0.34, deviation=0.1)], LAYOUT)
    changed = np.flatnonzero((drawn.targets != plan.targets).any(axis=1))
    np.testing.assert_array_equal(changed, [3])
    np.testing.assert_array_equal(plan.targets, kept[0])
    np.testing.assert_array_equal(plan.weights, kept[1])


def test_two_looks_at_one_place_are_one_of_more_precision(rng):
    """Precisions add, in any order; agreeing wishes may differ by their deviations."""
    plan = random_plan(rng)
    first = via_point("position x", 0.5, time=0.6, deviation=0.3)
    second = via_point("position x", 0.7, time=0.6, deviation=0.1)
    mean = (0.5 / 0.09 + 0.7 / 0.01) / (1 / 0.09 + 1 / 0.01)
    both = via_point("position x", mean, time=0.6, deviation=(1 / 0.09 + 1 / 0.01) ** -0.5)
    expected = condition_on(plan, [both], LAYOUT)
    for points in ([first, second], [second, first]):
        drawn = condition_on(plan, points, LAYOUT)
        np.testing.assert_allclose(drawn.targets, expected.targets, rtol=1e-9)
        np.testing.assert_allclose(drawn.weights, expected.weights, rtol=1e-12)


@pytest.mark.parametrize("deviation", [1e-3, 1e-5, 1e-7])
def test_a_precise_point_is_passed_within_its_deviation(rng, deviation):
    """As exactly as asked, seven orders of magnitude finer than the rest of the plan."""
    point = via_point("position", [2.0, 1.0], time=0.6, deviation=deviation)
    assert (
        np.abs(tracked(condition_on(random_plan(rng), [point], LAYOUT))[6, :2] - point.value).max()
        < deviation
    )


def test_a_point_is_missed_by_the_square_of_its_deviation(rng):
    """By s^2 / (S + s^2) of the way, S the variance of motions there: ten times finer, 100 times closer."""
    plan = random_plan(rng)
    S = solve_batch(double_integrator(2, PERIOD), plan, CONTROL_COST, START).covariances[6, 0, 0]
    way = 2.0 - tracked(plan)[6, 0]
    for s in (0.1, 0.01):
        drawn = condition_on(plan, [via_point("position x", 2.0, time=0.6, deviation=s)], LAYOUT)
        assert 2.0 - tracked(drawn)[6, 0] == pytest.approx(way * s**2 / (S + s**2), rel=1e-6)


def test_a_free_step_is_drawn_only_where_the_point_says(rng):
    """A weight of zero leaves the other columns free, with their targets where they were."""
    plan = random_plan(rng)
    plan.weights[4] = 0.0
    drawn = condition_on(plan, [via_point("position x", 3.0, time=0.4, deviation=0.5)], LAYOUT)
    np.testing.assert_allclose(drawn.targets[4], [3.0, *plan.targets[4, 1:]])
    np.testing.assert_allclose(drawn.weights[4], np.diag([4.0, 0.0, 0.0, 0.0]))


def test_a_half_free_step_is_conditioned_all_the_same(rng):
    """Weights of rank one, of any scale: the point and what the plan insists on are both kept."""
    plan = random_plan(rng)
    line = np.array([1.0, 1.0, 0.0, 0.0])
    plan.weights[4], plan.targets[4] = 1e-6 * np.outer(line, line), 0.0
    drawn = condition_on(plan, [via_point("position x", 3.0, time=0.4, deviation=1e-7)], LAYOUT)
    np.testing.assert_allclose(drawn.targets[4], [3.0, -3.0, 0.0, 0.0], rtol=1e-4, atol=1e-9)


@pytest.fixture
def pose_plan(rng):
    """A robot that keeps its orientation q while it moves."""
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    layout = pose_layout().differentiate()
    targets = np.zeros((STEPS, 14))
    targets[:, 3:7] = q
    return Reference(targets, np.tile(np.eye(14), (STEPS, 1, 1)), PERIOD), layout, q


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_orientation_may_be_given_as_q_or_minus_q(pose_plan, rng, sign):
    """One orientation, one plan: no via-point makes the robot turn all the way round."""
    plan, layout, q = pose_plan
    wished = q + 0.3 * rng.normal(size=4)
    wished /= np.linalg.norm(wished)
    drawn = condition_on(plan, [via_point("orientation", sign * wished, time=0.5, deviation=0.01)], layout)
    same = condition_on(plan, [via_point("orientation", wished, time=0.5, deviation=0.01)], layout)
    np.testing.assert_allclose(drawn.targets, same.targets)
    assert drawn.targets[5, 3:7] @ q > 0.0


def test_an_orientation_may_be_typed_to_three_digits(pose_plan):
    """A norm of one but for rounding is brought to one; how fast it changes has any norm."""
    plan, layout, q = pose_plan
    exact = condition_on(plan, [via_point("orientation", q, time=0.5, deviation=0.01)], layout)
    typed = condition_on(plan, [via_point("orientation", 1.0005 * q, time=0.5, deviation=0.01)], layout)
    np.testing.assert_allclose(typed.targets, exact.targets, atol=1e-12)
    turning = condition_on(plan, [via_point("orientation'", 3.0 * q, time=0.5, deviation=1e-6)], layout)
    np.testing.assert_allclose(turning.targets[5, 10:], 3.0 * q)


def test_the_deviation_of_an_orientation_is_an_angle(pose_plan):
    """A turn by one deviation away from the wish costs as much as a position one deviation away."""
    plan, layout, q = pose_plan
    drawn = condition_on(plan, [via_point("orientation", q, time=0.5, deviation=0.02)], layout)
    aside = q + 1e-2 * np.linalg.svd(q[None])[2][1]  # off along a direction orthogonal to q
    aside /= np.linalg.norm(aside)
    assert angle(q, aside) == pytest.approx(0.02, rel=1e-3)
    added = drawn.weights[5, 3:7, 3:7] - np.eye(4)
    assert (aside - q) @ added @ (aside - q) == pytest.approx(1.0, rel=1e-3)


def test_points_outside_the_plans_time_are_refused(rng):
    plan = random_plan(rng)
    for time in (0.0, 0.04, 1.16, 50.0):
        with pytest.raises(InvalidInput, match=r"expected 0.1 to 1.1 s"):
            condition_on(plan, [via_point("position", [0.0, 0.0], time=time, deviation=0.1)], LAYOUT)
    condition_on(plan, [via_point("position", [0.0, 0.0], time=1.14, deviation=0.1)], LAYOUT)
    with pytest.raises(InvalidInput, match="no period"):
        condition_on(
            replace(plan, period=None), [via_point("position x", 0.0, time=1.0, deviation=0.1)], LAYOUT
        )


def test_contradictions_are_refused(rng):
    """Two places for one column at one step, further apart than both deviations together."""
    plan, here = random_plan(rng), via_point("position", [0.0, 0.0], time=0.5, deviation=0.1)
    with pytest.raises(InvalidInput, match=r"'position' and 'position y'.*0\.5 apart at step 5"):
        condition_on(plan, [here, via_point("position y", 0.5, time=0.5, deviation=0.1)], LAYOUT)
    with pytest.raises(InvalidInput, match=r"0\.7 apart at step 5, in column 0"):
        condition_on(plan, [here, via_point("position", [0.7, 0.3], time=0.5, deviation=0.1)], LAYOUT)
    condition_on(plan, [here, via_point("position y", 0.19, time=0.5, deviation=0.1)], LAYOUT)
    condition_on(plan, [here, via_point("position y", 0.5, time=0.6, deviation=0.1)], LAYOUT)


@pytest.mark.parametrize("deviation", [5e-324, 1e-170, 1e-155, 1e-60, 1e60, 1e155, 1e308])
def test_deviation_whose_square_is_lost_is_refused_where_the_point_is_made(deviation):
    """Its square or the reciprocal of it would be 0, infinite or NaN."""
    with pytest.raises(InvalidInput, match=r"^the deviation of 'position' is .*from 1e-50 to 1e\+50"):
        via_point("position", [0.0, 0.0], time=0.5, deviation=deviation)


@pytest.mark.parametrize("deviation", [1e-49, 1e-30, 1e-20, 1e-15, 1e-11])
def test_deviation_far_below_that_of_the_plan_is_refused_by_its_name(rng, deviation):
    """The message says which deviation the plan can still resolve, and that one works."""
    plan = random_plan(rng)

    def drawn(size):
        return condition_on(plan, [via_point("position", [0.5, -0.4], time=0.5, deviation=size)], LAYOUT)

    with pytest.raises(InvalidInput, match=r"^the deviation of 'position' is .*expected at least") as refused:
        drawn(deviation)
    least = float(str(refused.value).split("at least ")[1].split(",")[0])
    np.testing.assert_allclose(tracked(drawn(1.01 * least))[5, :2], [0.5, -0.4], atol=1e-12)


@pytest.mark.parametrize("broken", ["targets", "weights"])
def test_reference_that_is_not_finite_is_not_drawn_through_points(rng, broken):
    """LAPACK may not return from NaN."""
    plan = random_plan(rng)
    array = getattr(plan, broken).copy()
    array[5] = np.nan
    with pytest.raises(InvalidInput, match=rf"the reference's {broken}\[5, 0.* is nan"):
        condition_on(
            replace(plan, **{broken: array}), [via_point("position y", 0.0, time=0.5, deviation=0.1)], LAYOUT
        )


def test_points_that_mean_nothing_are_refused(rng, pose_plan):
    plan, layout, q = pose_plan
    with pytest.raises(InvalidInput, match="did you mean 'position'"):
        condition_on(plan, [via_point("posit", np.zeros(3), time=0.5, deviation=0.1)], layout)
    with pytest.raises(InvalidInput, match="2 numbers, expected 3: position x, position y, position z"):
        condition_on(plan, [via_point("position", np.zeros(2), time=0.5, deviation=0.1)], layout)
    with pytest.raises(InvalidInput, match=r"norm 2.*unit quaternion"):
        condition_on(plan, [via_point("orientation", 2.0 * q, time=0.5, deviation=0.1)], layout)
    with pytest.raises(InvalidInput, match="finite"):
        via_point("position", [0.0, np.nan, 0.0], time=0.5, deviation=0.1)
    for deviation in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(InvalidInput, match="positive"):
            via_point("position", np.zeros(3), time=0.5, deviation=deviation)
    with pytest.raises(InvalidInput, match="one for all"):
        via_point("position", np.zeros(3), time=0.5, deviation=[0.1, 0.2])
    for time in (-1.0, np.nan, np.inf):
        with pytest.raises(InvalidInput, match="seconds after"):
            via_point("position", np.zeros(3), time=time, deviation=0.1)


def test_a_part_of_one_number_and_one_of_four_that_does_not_turn(rng):
    """A gripper's width is named by its part; four joints are four numbers, of any norm."""
    layout = Layout((Part("gripper", Quantity.SCALAR, 1, "m"), Part("joints", Quantity.SCALAR, 4, "rad")))
    plan = Reference(np.zeros((4, 5)), np.tile(np.eye(5), (4, 1, 1)), PERIOD)
    wished = np.array([-3.0, 2.0, -2.0, 1.0])
    points = [
        via_point("gripper", 0.08, time=0.1, deviation=1e-6),
        via_point("joints", wished, time=0.2, deviation=1e-6),
        ViaPoint("joints 2", np.array([1.0]), 0.3, np.array([1.0])),
    ]
    drawn = condition_on(plan, points, layout)
    np.testing.assert_allclose(drawn.targets[1], [0.08, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(drawn.targets[2, 1:], wished)
    np.testing.assert_allclose(drawn.targets[3], [0.0, 0.0, 0.5, 0.0, 0.0])


def two_ways(noise=1e-3):
    """From the origin either over the left (states 1) or over the right (2) to a common goal (3)."""
    chain = SemiMarkovChain(
        np.array([1.0, 0.0, 0.0, 0.0]),
        np.array([[0.0, 0.7, 0.3, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0], np.zeros(4)]),
        GaussianDurations(np.full(4, 8.0), np.full(4, 1.5)),
    )
    means = np.zeros((4, 4))
    means[1, :2], means[2, :2], means[3, :2] = [-1.0, 1.0], [1.0, 1.0], [0.0, 2.0]
    return AdaptedSkill(chain, means, np.tile(noise * np.eye(4), (4, 1, 1)), LAYOUT, PERIOD)


def test_a_point_on_the_rarer_way_makes_the_plan_take_it():
    """Drawn through the point, the common way would be left for it and taken up again."""
    model, start = two_ways(), np.zeros(4)
    point = via_point("position x", 0.8, time=1.2, deviation=0.1)
    usual = plan(model, start, horizon=30)
    assert usual.targets[:, 0].min() == -1.0
    chosen = plan_through(model, start, [point], horizon=30)
    assert chosen.targets[:, 0].min() == 0.0
    np.testing.assert_allclose(np.delete(chosen.targets, 12, axis=0).max(axis=0)[:2], [1.0, 2.0])
    assert condition_on(usual, [point], LAYOUT).targets[:, 0].min() == -1.0


def test_a_point_makes_a_state_come_early_or_late():
    """A state holds the step at which its place is wished, when its durations can bring that about."""
    model, start = two_ways(), np.zeros(4)
    for time in (1.3, 2.1):
        point = via_point("position", [0.0, 2.0], time=time, deviation=0.05)
        states = plan_through(model, start, [point], horizon=40).targets[:, 1]
        first = np.flatnonzero(states == 2.0)[0]
        assert first <= round(time / PERIOD)
    late = via_point("position", [-1.0, 1.0], time=1.9, deviation=0.05)
    assert plan(model, start, horizon=40).targets[19, 1] == 2.0
    assert plan_through(model, start, [late], horizon=40).targets[19, 1] == pytest.approx(1.0)


def test_without_points_it_is_the_plan(rng):
    model = two_ways()
    for start in (np.zeros(4), model.means[2], rng.normal(size=4)):
        expected, found = plan(model, start, horizon=30), plan_through(model, start, [], horizon=30)
        np.testing.assert_array_equal(found.targets, expected.targets)
        np.testing.assert_array_equal(found.weights, expected.weights)


def listed_posteriors(model, start, value, deviation, step):
    """p(state | start, noisy position at a step) at five steps of a Markov skill, path by path."""
    chain, S, K, total = model.dynamics, model.covariances, model.states, np.zeros((5, model.states))
    begins = [multivariate_normal(model.means[k], S[k]).pdf(start) for k in range(K)]
    noise = np.diag(deviation**2)
    passes = [multivariate_normal(model.means[k, :2], S[k][:2, :2] + noise).pdf(value) for k in range(K)]
    for path in itertools.product(range(K), repeat=5):
        p = chain.initial[path[0]] * np.prod([chain.transitions[i, j] for i, j in itertools.pairwise(path)])
        total[np.arange(5), path] += p * begins[path[0]] * passes[path[step]]
    return total / total.sum(axis=1, keepdims=True)


def test_states_are_the_most_probable_given_the_start_and_the_points(rng):
    """Against listing every sequence of states of short Markov skills."""
    K, step = 3, 3
    for _ in range(30):
        A = rng.normal(size=(K, 4, 4))
        chain = MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K))
        covariances = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(4)
        model = AdaptedSkill(chain, rng.normal(size=(K, 4)), covariances, LAYOUT, PERIOD)
        start, value, deviation = rng.normal(size=4), 2.0 * rng.normal(size=2), rng.uniform(0.1, 3.0, size=2)
        states = listed_posteriors(model, start, value, deviation, step).argmax(axis=1)
        point = via_point("position", value, time=step * PERIOD, deviation=deviation)
        targets = plan_through(model, start, [point], horizon=5).targets
        others = [0, 1, 2, 4]
        np.testing.assert_array_equal(targets[others], model.means[states][others])


def test_a_robot_that_reports_minus_q_gets_the_same_plan(rng):
    """On the other half of S^3; the orientation wished may be given on either."""
    layout, rest = pose_layout(), rng.normal(size=(2, 7))
    rest[:, 3:] /= np.linalg.norm(rest[:, 3:], axis=1, keepdims=True)
    chain = SemiMarkovChain(np.eye(2)[0], np.eye(2, k=1), GaussianDurations(np.full(2, 5.0), np.ones(2)))
    model = AdaptedSkill(chain, rest, np.tile(1e-2 * np.eye(7), (2, 1, 1)), layout, PERIOD)
    points = [via_point("orientation", rest[0, 3:], time=0.7, deviation=0.1)]
    signs = np.repeat([1.0, -1.0], [3, 4])
    told = plan_through(model, rest[0], points, horizon=12).targets
    other = plan_through(model, signs * rest[0], points, horizon=12).targets
    np.testing.assert_allclose(other, signs * told, atol=1e-12)


def test_a_mixture_or_an_unusable_start_is_refused():
    model = two_ways()
    with pytest.raises(InvalidInput, match="no order in time"):
        plan_through(replace(model, dynamics=MixtureWeights(np.full(4, 0.25))), np.zeros(4), [], horizon=9)
    with pytest.raises(InvalidInput, match="not finite"):
        plan_through(model, np.full(4, np.nan), [], horizon=9)
    point = via_point("position x", 0.0, time=0.9, deviation=1.0)
    with pytest.raises(InvalidInput, match=r"0\.1 to 0\.8 s"):
        plan_through(model, np.zeros(4), [point], horizon=9)


@pytest.fixture
def curved(rng):
    """A pose that turns on S^3 through three states about a radian apart."""
    q = from_rotation_vector(np.cumsum(rng.normal(size=(3, 3)), axis=0))
    layout = replace_quaternion(pose_layout()).differentiate()
    means = np.hstack([rng.normal(size=(3, 3)), q, np.zeros((3, 6))])
    chain = SemiMarkovChain(np.eye(3)[0], np.eye(3, k=1), GaussianDurations(np.full(3, 8.0), np.ones(3)))
    return AdaptedSkill(chain, means, np.tile(1e-2 * np.eye(12), (3, 1, 1)), layout, PERIOD)


def replace_quaternion(layout):
    return Layout((layout.parts[0], replace(layout.parts[1], quantity=Quantity.ORIENTATION)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_orientations_on_the_sphere_are_passed_on_their_map(rng, curved, sign):
    """Wished as q or -q, near the way or half a radian off it: the body is turned so at that time."""
    here, start = tangent_chart(curved), curved.means[0]
    q = multiply(curved.means[1, 3:7], from_rotation_vector(0.5 * rng.normal(size=3)))
    place = curved.means[1, :3] + 0.1
    time = 1.2
    points = [
        via_point_to_tangent(via_point("orientation", sign * q, time=time, deviation=1e-4), here),
        via_point_to_tangent(via_point("position", place, time=time, deviation=1e-4), here),
        via_point_to_tangent(via_point("orientation'", np.zeros(3), time=time, deviation=1e-4), here),
    ]
    robot = double_integrator(6, PERIOD)
    for drawn in (
        condition_on(plan(here.skill, here.to_tangent(start), horizon=25), points, here.skill.layout),
        plan_through(here.skill, here.to_tangent(start), points, horizon=25),
    ):
        x = here.to_manifold(track(robot, drawn, 0.1).rollout(here.to_tangent(start)).x)
        assert angle(x[12, 3:7], q) < 1e-4
        assert np.linalg.norm(x[12, :3] - place) < 1e-4
        assert np.linalg.norm(x[12, 10:]) < 1e-3
        assert np.max(angle(x[1:, 3:7], x[:-1, 3:7])) < 1.0


def test_the_deviation_on_the_map_is_that_angle_at_its_base(curved):
    """A turn by one deviation from the wish costs one there, about every axis."""
    base = tangent_chart(curved).bases[0]
    here = tangent_chart(curved, base_pose=np.concatenate([np.zeros(3), base, np.zeros(6)]))
    point = via_point_to_tangent(via_point("orientation", base, time=0.5, deviation=0.02), here)
    np.testing.assert_allclose(point.value, 0.0, atol=1e-12)
    np.testing.assert_array_equal(point.deviation, np.full(3, 0.02))


def test_wishes_that_have_no_place_on_a_map_are_refused(curved):
    here, q = tangent_chart(curved), curved.means[0, 3:7]
    with pytest.raises(InvalidInput, match="norm 2"):
        via_point_to_tangent(via_point("orientation", 2.0 * q, time=1.0, deviation=0.1), here)
    for what, value, deviation in (
        ("orientation", q[:3], 0.1),
        ("orientation w", 1.0, 0.1),
        ("orientation", q, [0.1, 0.1, 0.1, 0.2]),
    ):
        with pytest.raises(InvalidInput, match="whole unit quaternion"):
            via_point_to_tangent(via_point(what, value, time=1.0, deviation=deviation), here)
    flat, wish = (
        plan(here.skill, here.skill.means[0], horizon=9),
        via_point("orientation", q, time=0.5, deviation=0.1),
    )
    with pytest.raises(InvalidInput, match=r"4 numbers, expected 3.*on_chart"):
        condition_on(flat, [wish], here.skill.layout)
    with pytest.raises(InvalidInput, match="expected 0"):
        via_point_to_tangent(via_point("orientation'", [0.0, 1.0, 0.0], time=1.0, deviation=0.1), here)
