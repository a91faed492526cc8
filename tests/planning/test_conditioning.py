"""Via-points: the conditioned plan equals the trajectory distribution conditioned on measurements."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.control import Reference, double_integrator, solve_batch, track
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.planning import (
    ViaPoint,
    condition_on,
    via_point,
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
    """Return mean and covariance of all states, of density exp(-cost / 2), from the definition."""
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


def condition_gaussian(mean, covariance, entries, values, deviations):
    """Condition a Gaussian on measurements of some entries with independent noise."""
    innovation = covariance[np.ix_(entries, entries)] + np.diag(np.square(deviations))
    gain = np.linalg.solve(innovation, covariance[entries]).T
    return mean + gain @ (values - mean[entries]), covariance - gain @ covariance[entries]


def track_from_start(plan):
    return track(double_integrator(2, PERIOD), plan, CONTROL_COST).rollout(START).x


def test_condition_on_tracking_equals_conditioned_trajectory_distribution(rng):
    """Compare with one Gaussian over all steps, conditioned by the textbook formula."""
    plan = random_plan(rng)
    points = [
        via_point("position", [0.5, -0.4], time=0.5, deviation=0.01),
        via_point("position y", 0.9, time=0.8, deviation=0.2),
        via_point("position'", [0.0, 1.0], time=0.8, deviation=[0.1, 1e-3]),
    ]
    entries = [5 * 4, 5 * 4 + 1, 8 * 4 + 1, 8 * 4 + 2, 8 * 4 + 3]
    values, deviations = np.array([0.5, -0.4, 0.9, 0.0, 1.0]), np.array([0.01, 0.01, 0.2, 0.1, 1e-3])
    mean, covariance = condition_gaussian(*joint_distribution(plan), entries, values, deviations)
    conditioned = condition_on(plan, points, LAYOUT)
    np.testing.assert_allclose(track_from_start(conditioned), mean.reshape(STEPS, 4), atol=1e-8)
    _, covariances = solve_batch(double_integrator(2, PERIOD), conditioned, CONTROL_COST, START)
    for t in range(STEPS):
        block = covariance[4 * t : 4 * t + 4, 4 * t : 4 * t + 4]
        np.testing.assert_allclose(covariances[t], block, atol=1e-8)


def test_condition_on_no_points_is_identity(rng):
    plan = random_plan(rng)
    conditioned = condition_on(plan, [], LAYOUT)
    np.testing.assert_array_equal(conditioned.targets, plan.targets)
    np.testing.assert_array_equal(conditioned.weights, plan.weights)
    assert conditioned.period == plan.period


def test_condition_on_changes_steps_of_points_only(rng):
    plan = random_plan(rng)
    targets, weights = plan.targets.copy(), plan.weights.copy()
    conditioned = condition_on(plan, [via_point("position", [1.0, 1.0], time=0.34, deviation=0.1)], LAYOUT)
    changed = np.flatnonzero((conditioned.targets != plan.targets).any(axis=1))
    np.testing.assert_array_equal(changed, [3])
    np.testing.assert_array_equal(plan.targets, targets)
    np.testing.assert_array_equal(plan.weights, weights)


def test_condition_on_two_points_equal_one_of_summed_precision(rng):
    """Precisions add, in any order; values may differ by their deviations."""
    plan = random_plan(rng)
    first = via_point("position x", 0.5, time=0.6, deviation=0.3)
    second = via_point("position x", 0.7, time=0.6, deviation=0.1)
    mean = (0.5 / 0.09 + 0.7 / 0.01) / (1 / 0.09 + 1 / 0.01)
    both = via_point("position x", mean, time=0.6, deviation=(1 / 0.09 + 1 / 0.01) ** -0.5)
    expected = condition_on(plan, [both], LAYOUT)
    for points in ([first, second], [second, first]):
        conditioned = condition_on(plan, points, LAYOUT)
        np.testing.assert_allclose(conditioned.targets, expected.targets, rtol=1e-9)
        np.testing.assert_allclose(conditioned.weights, expected.weights, rtol=1e-12)


@pytest.mark.parametrize("deviation", [1e-3, 1e-5, 1e-7])
def test_condition_on_precise_point_is_passed_within_deviation(rng, deviation):
    """The error is below the deviation, up to seven orders of magnitude below that of the plan."""
    point = via_point("position", [2.0, 1.0], time=0.6, deviation=deviation)
    assert (
        np.abs(track_from_start(condition_on(random_plan(rng), [point], LAYOUT))[6, :2] - point.value).max()
        < deviation
    )


def test_condition_on_error_is_stated_fraction(rng):
    """The remaining error is the fraction s^2 / (S + s^2), with S the variance at that step."""
    plan = random_plan(rng)
    S = solve_batch(double_integrator(2, PERIOD), plan, CONTROL_COST, START)[1][6, 0, 0]
    distance = 2.0 - track_from_start(plan)[6, 0]
    for s in (0.1, 0.01):
        conditioned = condition_on(plan, [via_point("position x", 2.0, time=0.6, deviation=s)], LAYOUT)
        assert 2.0 - track_from_start(conditioned)[6, 0] == pytest.approx(
            distance * s**2 / (S + s**2), rel=1e-6
        )


def test_condition_on_free_step_changes_measured_columns_only(rng):
    """A zero weight leaves other columns free, with their targets unchanged."""
    plan = random_plan(rng)
    plan.weights[4] = 0.0
    conditioned = condition_on(plan, [via_point("position x", 3.0, time=0.4, deviation=0.5)], LAYOUT)
    np.testing.assert_allclose(conditioned.targets[4], [3.0, *plan.targets[4, 1:]])
    np.testing.assert_allclose(conditioned.weights[4], np.diag([4.0, 0.0, 0.0, 0.0]))


def test_condition_on_weight_of_rank_one_keeps_plan_and_point(rng):
    """A weight of rank one, of any scale: via-point and plan are both satisfied."""
    plan = random_plan(rng)
    line = np.array([1.0, 1.0, 0.0, 0.0])
    plan.weights[4], plan.targets[4] = 1e-6 * np.outer(line, line), 0.0
    conditioned = condition_on(plan, [via_point("position x", 3.0, time=0.4, deviation=1e-7)], LAYOUT)
    np.testing.assert_allclose(conditioned.targets[4], [3.0, -3.0, 0.0, 0.0], rtol=1e-4, atol=1e-9)


@pytest.fixture
def pose_plan(rng):
    """Return a plan with constant orientation q."""
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    layout = pose_layout().differentiate()
    targets = np.zeros((STEPS, 14))
    targets[:, 3:7] = q
    return Reference(targets, np.tile(np.eye(14), (STEPS, 1, 1)), PERIOD), layout, q


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_condition_on_orientation_is_independent_of_sign(pose_plan, rng, sign):
    """Q and -q give the same plan, without a full turn."""
    plan, layout, q = pose_plan
    value = q + 0.3 * rng.normal(size=4)
    value /= np.linalg.norm(value)
    conditioned = condition_on(
        plan, [via_point("orientation", sign * value, time=0.5, deviation=0.01)], layout
    )
    same = condition_on(plan, [via_point("orientation", value, time=0.5, deviation=0.01)], layout)
    np.testing.assert_allclose(conditioned.targets, same.targets)
    assert conditioned.targets[5, 3:7] @ q > 0.0


def test_condition_on_rounded_quaternion_is_normalised(pose_plan):
    """A norm close to one is normalised; a rate of change may have any norm."""
    plan, layout, q = pose_plan
    exact = condition_on(plan, [via_point("orientation", q, time=0.5, deviation=0.01)], layout)
    typed = condition_on(plan, [via_point("orientation", 1.0005 * q, time=0.5, deviation=0.01)], layout)
    np.testing.assert_allclose(typed.targets, exact.targets, atol=1e-12)
    turning = condition_on(plan, [via_point("orientation'", 3.0 * q, time=0.5, deviation=1e-6)], layout)
    np.testing.assert_allclose(turning.targets[5, 10:], 3.0 * q)


def test_condition_on_deviation_of_orientation_is_angle(pose_plan):
    """A rotation by one deviation costs as much as a position one deviation away."""
    plan, layout, q = pose_plan
    conditioned = condition_on(plan, [via_point("orientation", q, time=0.5, deviation=0.02)], layout)
    neighbour = q + 1e-2 * np.linalg.svd(q[None])[2][1]  # in a direction orthogonal to q
    neighbour /= np.linalg.norm(neighbour)
    assert angle(q, neighbour) == pytest.approx(0.02, rel=1e-3)
    added = conditioned.weights[5, 3:7, 3:7] - np.eye(4)
    assert (neighbour - q) @ added @ (neighbour - q) == pytest.approx(1.0, rel=1e-3)


def test_condition_on_time_outside_plan_is_refused(rng):
    plan = random_plan(rng)
    for time in (0.0, 0.04, 1.16, 50.0):
        with pytest.raises(InvalidInput, match=r"expected 0.1 to 1.1 s"):
            condition_on(plan, [via_point("position", [0.0, 0.0], time=time, deviation=0.1)], LAYOUT)
    condition_on(plan, [via_point("position", [0.0, 0.0], time=1.14, deviation=0.1)], LAYOUT)
    with pytest.raises(InvalidInput, match="has no period"):
        condition_on(
            replace(plan, period=None), [via_point("position x", 0.0, time=1.0, deviation=0.1)], LAYOUT
        )


def test_condition_on_contradicting_points_are_refused(rng):
    """Two values of one column at one step differ by more than the sum of their deviations."""
    plan, first = random_plan(rng), via_point("position", [0.0, 0.0], time=0.5, deviation=0.1)
    with pytest.raises(InvalidInput, match=r"'position' and 'position y' differ by 0\.5 at step 5"):
        condition_on(plan, [first, via_point("position y", 0.5, time=0.5, deviation=0.1)], LAYOUT)
    with pytest.raises(InvalidInput, match=r"0\.7 at step 5, in column 0"):
        condition_on(plan, [first, via_point("position", [0.7, 0.3], time=0.5, deviation=0.1)], LAYOUT)
    condition_on(plan, [first, via_point("position y", 0.19, time=0.5, deviation=0.1)], LAYOUT)
    condition_on(plan, [first, via_point("position y", 0.5, time=0.6, deviation=0.1)], LAYOUT)


@pytest.mark.parametrize("deviation", [5e-324, 1e-170, 1e-155, 1e-60, 1e60, 1e155, 1e308])
def test_via_point_extreme_deviation_is_refused(deviation):
    """Its square or reciprocal would be 0, infinite or NaN."""
    with pytest.raises(InvalidInput, match=r"^the deviation of 'position' is .*from 1e-50 to 1e\+50"):
        via_point("position", [0.0, 0.0], time=0.5, deviation=deviation)


@pytest.mark.parametrize("deviation", [1e-49, 1e-30, 1e-20, 1e-15, 1e-11])
def test_condition_on_unresolvable_deviation_is_refused(rng, deviation):
    """The message gives the smallest deviation that the plan resolves, and that one works."""
    plan = random_plan(rng)

    def conditioned(size):
        return condition_on(plan, [via_point("position", [0.5, -0.4], time=0.5, deviation=size)], LAYOUT)

    with pytest.raises(InvalidInput, match=r"^the deviation of 'position' is .*expected at least") as refused:
        conditioned(deviation)
    smallest = float(str(refused.value).split("at least ")[1].split(",")[0])
    np.testing.assert_allclose(track_from_start(conditioned(1.01 * smallest))[5, :2], [0.5, -0.4], atol=1e-12)


@pytest.mark.parametrize("broken", ["targets", "weights"])
def test_condition_on_reference_not_finite_is_refused(rng, broken):
    """LAPACK may not return from NaN."""
    plan = random_plan(rng)
    array = getattr(plan, broken).copy()
    array[5] = np.nan
    with pytest.raises(InvalidInput, match=rf"the reference's {broken}\[5, 0.* is nan"):
        condition_on(
            replace(plan, **{broken: array}), [via_point("position y", 0.0, time=0.5, deviation=0.1)], LAYOUT
        )


def test_via_point_unusable_value_is_refused(rng, pose_plan):
    plan, layout, q = pose_plan
    with pytest.raises(InvalidInput, match="did you mean 'position'"):
        condition_on(plan, [via_point("posit", np.zeros(3), time=0.5, deviation=0.1)], layout)
    with pytest.raises(InvalidInput, match="has 2 numbers, expected 3: position x, position y, position z"):
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


def test_condition_on_scalar_parts_are_measured_by_column(rng):
    """A gripper's width is named by its part; four joints have any norm."""
    layout = Layout((Part("gripper", Quantity.SCALAR, 1, "m"), Part("joints", Quantity.SCALAR, 4, "rad")))
    plan = Reference(np.zeros((4, 5)), np.tile(np.eye(5), (4, 1, 1)), PERIOD)
    joints = np.array([-3.0, 2.0, -2.0, 1.0])
    points = [
        via_point("gripper", 0.08, time=0.1, deviation=1e-6),
        via_point("joints", joints, time=0.2, deviation=1e-6),
        ViaPoint("joints 2", np.array([1.0]), 0.3, np.array([1.0])),
    ]
    conditioned = condition_on(plan, points, layout)
    np.testing.assert_allclose(conditioned.targets[1], [0.08, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(conditioned.targets[2, 1:], joints)
    np.testing.assert_allclose(conditioned.targets[3], [0.0, 0.0, 0.5, 0.0, 0.0])
