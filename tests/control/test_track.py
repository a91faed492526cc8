"""Finite-horizon LQT in discrete time."""

import numpy as np
import pytest

from pilotfish.control import Reference, TimeVaryingSystem, double_integrator, solve_batch, track

SIZES = [(1, 1, 2), (2, 1, 2), (4, 2, 12), (3, 5, 7), (6, 3, 40)]


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize(("n", "m", "T"), SIZES)
def test_track_motion_equals_solve_batch(random_problem, n, m, T, varying):
    """The Riccati recursion and the normal equations give the same motion, to 1e-9 of its size."""
    p = random_problem(n, m, T, varying=varying)
    recursive = track(p.system, p.reference, p.control_cost).rollout(p.start)
    batch = solve_batch(p.system, p.reference, p.control_cost, p.start)[0]
    np.testing.assert_allclose(recursive.x, batch.x, rtol=0, atol=1e-9 * np.abs(batch.x).max())
    np.testing.assert_allclose(recursive.u, batch.u, rtol=0, atol=1e-9 * np.abs(batch.u).max())
    assert recursive.period == batch.period == p.system.period


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize(("n", "m", "T"), SIZES)
def test_track_inputs_minimise_cost(rng, random_problem, n, m, T, varying):
    """The cost rises in every direction, equally both ways: its derivative is zero."""
    p = random_problem(n, m, T, varying=varying)
    motion = track(p.system, p.reference, p.control_cost).rollout(p.start)
    minimum = p.cost(motion.u)
    np.testing.assert_allclose(motion.x, p.simulate(motion.u), atol=1e-12 * np.abs(motion.x).max())
    for direction in rng.normal(size=(10, *motion.u.shape)):
        above, below = p.cost(motion.u + direction), p.cost(motion.u - direction)
        rise = 0.5 * (above + below) - minimum  # exact: the cost is quadratic
        assert rise > 0
        assert abs(above - below) / 2 < 1e-8 * (rise + minimum)


@pytest.mark.parametrize("varying", [False, True])
def test_track_restarted_on_the_way_gives_same_motion(random_problem, varying):
    """Bellman: from a state on the way, with the rest of the reference, the motion is the same."""
    p = random_problem(4, 2, 15, varying=varying)
    motion = track(p.system, p.reference, p.control_cost).rollout(p.start)
    rest = Reference(p.reference.targets[6:], p.reference.weights[6:])
    system = TimeVaryingSystem(p.system.A[6:], p.system.B[6:], p.system.period) if varying else p.system
    restarted = track(system, rest, p.control_cost).rollout(motion.x[6])
    np.testing.assert_allclose(restarted.x, motion.x[6:], rtol=1e-9, atol=1e-9)


def test_track_constant_time_varying_system_equals_time_invariant(random_problem):
    """A time-varying system with constant matrices equals the time-invariant one."""
    p = random_problem(4, 2, 9)
    varying = TimeVaryingSystem(np.stack([p.system.A] * 8), np.stack([p.system.B] * 8), p.system.period)
    constant, same = (track(system, p.reference, p.control_cost) for system in (p.system, varying))
    np.testing.assert_allclose(constant.gains, same.gains, rtol=1e-12)
    np.testing.assert_allclose(constant.rollout(p.start).x, same.rollout(p.start).x, rtol=1e-12)


def test_track_free_motion_needs_no_input(rng):
    """Targets on a free motion need no feedforward and no input, whatever the weights."""
    system = double_integrator(2, 0.1)
    targets = [rng.normal(size=4)]
    for _ in range(19):
        targets.append(system.A @ targets[-1])
    root = rng.normal(size=(20, 4, 4))
    reference = Reference(np.array(targets), root @ np.swapaxes(root, 1, 2))
    feedback = track(system, reference, 0.5)
    np.testing.assert_allclose(feedback.feedforwards, 0, atol=1e-10)
    np.testing.assert_allclose(feedback.rollout(targets[0]).x, targets, atol=1e-10)


def test_track_scaled_costs_give_same_feedback(random_problem):
    """Scaling weights and R by one number changes nothing; R may be a number."""
    p = random_problem(4, 3, 10)
    scaled = Reference(p.reference.targets, 7.0 * p.reference.weights)
    expected, found = track(p.system, p.reference, 2.0 * np.eye(3)), track(p.system, scaled, 14.0)
    np.testing.assert_allclose(found.gains, expected.gains, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.feedforwards, expected.feedforwards, rtol=1e-10, atol=1e-12)


def test_track_input_equals_stiffness_damping_and_feedforward(rng, stepwise):
    """Equation 3.52: u = K^P (target - x) of positions + K^V (target - x) of velocities + feedforward."""
    feedback = track(double_integrator(3, 0.1), stepwise(6, 12), 0.1)
    assert feedback.stiffness.shape == feedback.damping.shape == (11, 3, 3)
    motion = feedback.rollout(rng.normal(size=6))
    for t in range(11):
        error = feedback.reference.targets[t] - motion.x[t]
        u = feedback.stiffness[t] @ error[:3] + feedback.damping[t] @ error[3:] + feedback.feedforwards[t]
        np.testing.assert_allclose(u, motion.u[t], rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(feedback.command(t, motion.x[t]), motion.u[t])


def test_track_equal_weights_give_isotropic_positive_gains(stepwise):
    """With equal weights on all axes, stiffness and damping are positive multiples of the identity."""
    weights = np.broadcast_to(np.diag([50.0, 50.0, 1.0, 1.0]), (60, 4, 4))  # a view, as a user may give
    feedback = track(double_integrator(2, 0.1), Reference(np.zeros((60, 4)), weights), 1.0)
    for gain in (feedback.stiffness[0], feedback.damping[0]):
        assert gain[0, 0] > 0
        np.testing.assert_allclose(gain, gain[0, 0] * np.eye(2), atol=1e-12)


def test_track_two_starts_converge(rng, stepwise):
    """Motions from two starts converge."""
    feedback = track(double_integrator(2, 0.1), stepwise(4, 200), 0.1)
    first, second = feedback.rollout(rng.normal(size=4)), feedback.rollout(rng.normal(size=4))
    distance = np.linalg.norm(first.x - second.x, axis=1)
    assert distance[150] < 1e-3 * distance[0]


def test_track_transformed_world_transforms_motion(rng, stepwise):
    """A rotation and translation of start, targets and weights transforms the motion."""
    system, reference, start = double_integrator(3, 0.1), stepwise(6, 25), rng.normal(size=6)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn = np.kron(np.eye(2), rotation)
    shift = np.concatenate([rng.normal(size=3), np.zeros(3)])
    moved = Reference(reference.targets @ turn.T + shift, turn @ reference.weights @ turn.T)
    motion = track(system, reference, 0.3).rollout(start)
    transformed = track(system, moved, 0.3).rollout(turn @ start + shift)
    np.testing.assert_allclose(transformed.x, motion.x @ turn.T + shift, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(transformed.u, motion.u @ rotation.T, rtol=1e-9, atol=1e-9)


def test_track_leaves_target_before_next_begins():
    """A mass leaves the first target before the second begins; with a larger R it leaves earlier."""
    targets = np.zeros((40, 2))
    targets[20:, 0] = 1.0
    reference = Reference(targets, np.stack([np.diag([100.0, 0.1])] * 40))
    position = [
        track(double_integrator(1, 0.1), reference, control_cost).rollout(np.zeros(2)).x[19, 0]
        for control_cost in (0.1, 1.0)
    ]
    assert 0.05 < position[0] < position[1] < 0.5
