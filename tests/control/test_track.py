"""Laws of tracking over a finite horizon in discrete time."""

import numpy as np
import pytest

from pilotfish.control import Reference, TimeVaryingSystem, double_integrator, solve_batch, track

SIZES = [(1, 1, 2), (2, 1, 2), (4, 2, 12), (3, 5, 7), (6, 3, 40)]


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize(("n", "m", "T"), SIZES)
def test_the_recursion_agrees_with_one_big_least_squares_problem(random_problem, n, m, T, varying):
    """Riccati's recursion and the stacked normal equations give the same motion, to 1e-9 of its size."""
    p = random_problem(n, m, T, varying=varying)
    recursive = track(p.system, p.reference, p.control_cost).rollout(p.start)
    batch = solve_batch(p.system, p.reference, p.control_cost, p.start).motion
    np.testing.assert_allclose(recursive.x, batch.x, rtol=0, atol=1e-9 * np.abs(batch.x).max())
    np.testing.assert_allclose(recursive.u, batch.u, rtol=0, atol=1e-9 * np.abs(batch.u).max())
    assert recursive.period == batch.period == p.system.period


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize(("n", "m", "T"), SIZES)
def test_no_other_inputs_cost_less(rng, random_problem, n, m, T, varying):
    """The cost rises in every direction, and evenly both ways: its derivative there is zero."""
    p = random_problem(n, m, T, varying=varying)
    motion = track(p.system, p.reference, p.control_cost).rollout(p.start)
    least = p.cost(motion.u)
    np.testing.assert_allclose(motion.x, p.simulate(motion.u), atol=1e-12 * np.abs(motion.x).max())
    for direction in rng.normal(size=(10, *motion.u.shape)):
        above, below = p.cost(motion.u + direction), p.cost(motion.u - direction)
        rise = 0.5 * (above + below) - least  # exact: the cost is quadratic
        assert rise > 0
        assert abs(above - below) / 2 < 1e-8 * (rise + least)


@pytest.mark.parametrize("varying", [False, True])
def test_the_rest_of_an_optimal_motion_is_optimal(random_problem, varying):
    """Bellman: started anew on the way, with the rest of the reference, the motion goes on as before."""
    p = random_problem(4, 2, 15, varying=varying)
    motion = track(p.system, p.reference, p.control_cost).rollout(p.start)
    rest = Reference(p.reference.targets[6:], p.reference.weights[6:])
    system = TimeVaryingSystem(p.system.A[6:], p.system.B[6:], p.system.period) if varying else p.system
    again = track(system, rest, p.control_cost).rollout(motion.x[6])
    np.testing.assert_allclose(again.x, motion.x[6:], rtol=1e-9, atol=1e-9)


def test_a_varying_system_that_does_not_vary_is_the_constant_one(random_problem):
    """Both kinds of system describe the same thing."""
    p = random_problem(4, 2, 9)
    varying = TimeVaryingSystem(np.stack([p.system.A] * 8), np.stack([p.system.B] * 8), p.system.period)
    one, other = (track(system, p.reference, p.control_cost) for system in (p.system, varying))
    np.testing.assert_allclose(one.gains, other.gains, rtol=1e-12)
    np.testing.assert_allclose(one.rollout(p.start).x, other.rollout(p.start).x, rtol=1e-12)


def test_a_reference_that_the_system_follows_by_itself_takes_no_input(rng):
    """Targets on an undriven motion: no feed-forward, no cost, whatever the weights."""
    system = double_integrator(2, 0.1)
    targets = [rng.normal(size=4)]
    for _ in range(19):
        targets.append(system.A @ targets[-1])
    root = rng.normal(size=(20, 4, 4))
    reference = Reference(np.array(targets), root @ np.swapaxes(root, 1, 2))
    feedback = track(system, reference, 0.5)
    np.testing.assert_allclose(feedback.feedforwards, 0, atol=1e-10)
    np.testing.assert_allclose(feedback.rollout(targets[0]).x, targets, atol=1e-10)


def test_only_the_ratio_of_the_two_prices_matters(random_problem):
    """Weights and effort times a number leave the feedback as it is; effort may be the number alone."""
    p = random_problem(4, 3, 10)
    dearer = Reference(p.reference.targets, 7.0 * p.reference.weights)
    one, other = track(p.system, p.reference, 2.0 * np.eye(3)), track(p.system, dearer, 14.0)
    np.testing.assert_allclose(one.gains, other.gains, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(one.feedforwards, other.feedforwards, rtol=1e-10, atol=1e-12)


def test_the_input_is_stiffness_and_damping_and_feedforward(rng, stepwise):
    """Equation 3.52: u = K^P (target - x) of positions + K^V (target - x) of velocities + feed-forward."""
    feedback = track(double_integrator(3, 0.1), stepwise(6, 12), 0.1)
    assert feedback.stiffness.shape == feedback.damping.shape == (11, 3, 3)
    motion = feedback.rollout(rng.normal(size=6))
    for t in range(11):
        error = feedback.reference.targets[t] - motion.x[t]
        push = feedback.stiffness[t] @ error[:3] + feedback.damping[t] @ error[3:] + feedback.feedforwards[t]
        np.testing.assert_allclose(push, motion.u[t], rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(feedback.command(t, motion.x[t]), motion.u[t])


def test_alike_positions_are_pulled_back_and_velocities_slowed(stepwise):
    """With the same weight on every axis, stiffness and damping are positive numbers times the identity."""
    weights = np.broadcast_to(np.diag([50.0, 50.0, 1.0, 1.0]), (60, 4, 4))  # a view, as a user may give
    feedback = track(double_integrator(2, 0.1), Reference(np.zeros((60, 4)), weights), 1.0)
    for half in (feedback.stiffness[0], feedback.damping[0]):
        assert half[0, 0] > 0
        np.testing.assert_allclose(half, half[0, 0] * np.eye(2), atol=1e-12)


def test_the_feedback_stabilises(rng, stepwise):
    """Two motions from different starts meet: gains of a long horizon shrink every difference."""
    feedback = track(double_integrator(2, 0.1), stepwise(4, 200), 0.1)
    one, other = feedback.rollout(rng.normal(size=4)), feedback.rollout(rng.normal(size=4))
    apart = np.linalg.norm(one.x - other.x, axis=1)
    assert apart[150] < 1e-3 * apart[0]


def test_turning_and_moving_the_world_turns_and_moves_the_motion(rng, stepwise):
    """A rotation of space, and another origin, given to start, targets and weights reappear in the motion."""
    system, reference, start = double_integrator(3, 0.1), stepwise(6, 25), rng.normal(size=6)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn = np.kron(np.eye(2), rotation)
    shift = np.concatenate([rng.normal(size=3), np.zeros(3)])
    moved = Reference(reference.targets @ turn.T + shift, turn @ reference.weights @ turn.T)
    here, there = (
        track(system, reference, 0.3).rollout(start),
        track(system, moved, 0.3).rollout(turn @ start + shift),
    )
    np.testing.assert_allclose(there.x, here.x @ turn.T + shift, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(there.u, here.u @ rotation.T, rtol=1e-9, atol=1e-9)


def test_tracking_looks_ahead():
    """A mass leaves the first target before the second begins; with a dearer effort it leaves earlier."""
    targets = np.zeros((40, 2))
    targets[20:, 0] = 1.0
    reference = Reference(targets, np.stack([np.diag([100.0, 0.1])] * 40))
    position = [
        track(double_integrator(1, 0.1), reference, control_cost).rollout(np.zeros(2)).x[19, 0]
        for control_cost in (0.1, 1.0)
    ]
    assert 0.05 < position[0] < position[1] < 0.5
