"""Infinite-horizon LQR in discrete time."""

from contextlib import suppress

import numpy as np
import pytest

from pilotfish.control import (
    LinearSystem,
    Reference,
    continuous_double_integrator,
    double_integrator,
    lqr,
    lqr_continuous,
    track,
)
from pilotfish.errors import InvalidInput


def steady_cost(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return P of the discrete algebraic Riccati equation from eigenvectors of the symplectic matrix.

    Source:
        Tanwani 2018, equation 3.55, with the sign of its upper right block corrected.
    """
    n, G, inverse = len(A), B @ np.linalg.inv(R) @ B.T, np.linalg.inv(A).T
    symplectic = np.block([[A + G @ inverse @ Q, -G @ inverse], [-inverse @ Q, inverse]])
    values, vectors = np.linalg.eig(symplectic)
    stable = vectors[:, np.abs(values) < 1]
    assert stable.shape[1] == n
    return np.real(stable[n:] @ np.linalg.inv(stable[:n]))


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (4, 2), (3, 5), (14, 7)])
def test_lqr_gains_equal_symplectic_eigenvector_solution(rng, random_problem, n, m):
    """SciPy's solver and the corrected construction of the thesis give the same gain."""
    p = random_problem(n, m, 3)
    A, B, R = p.system.A, p.system.B, p.control_cost
    W = np.eye(n) + p.reference.weights[0]
    P = steady_cost(A, B, W, R)
    feedback = lqr(p.system, Reference(p.reference.targets, np.stack([W] * 3)), R)
    expected = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    np.testing.assert_allclose(feedback.gains, [expected] * 2, rtol=1e-7, atol=1e-7)
    np.testing.assert_array_equal(feedback.feedforwards, 0)


@pytest.mark.parametrize(("n", "m"), [(2, 1), (4, 2), (3, 5)])
def test_lqr_gains_equal_those_of_long_horizon_track(random_problem, n, m):
    """Far from the end, the gains of a finite horizon equal those of the infinite one."""
    p = random_problem(n, m, 3)
    W = np.eye(n) + p.reference.weights[0]
    reference = Reference(np.zeros((300, n)), np.stack([W] * 300))
    finite, infinite = track(p.system, reference, p.control_cost), lqr(p.system, reference, p.control_cost)
    np.testing.assert_allclose(finite.gains[0], infinite.gains[0], rtol=1e-9, atol=1e-9)
    assert np.abs(finite.gains[-1] - infinite.gains[-1]).max() > 1e-4


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (4, 2), (3, 5)])
def test_lqr_closed_loop_is_stable(random_problem, n, m):
    """The closed loop of every weight is stable, for an unstable system."""
    p = random_problem(n, m, 6)
    system = LinearSystem(1.3 * p.system.A, p.system.B, 0.1)
    reference = Reference(p.reference.targets, p.reference.weights + 0.1 * np.eye(n))
    for K in lqr(system, reference, p.control_cost).gains:
        assert np.abs(np.linalg.eigvals(system.A - system.B @ K)).max() < 1


def test_lqr_cost_to_go_decreases_by_step_cost(random_problem):
    """E' P e is the cost-to-go: it decreases by the cost of each step, to zero."""
    p = random_problem(4, 2, 3)
    W = np.eye(4) + p.reference.weights[0]
    reference = Reference(np.zeros((80, 4)), np.stack([W] * 80))
    motion = lqr(p.system, reference, p.control_cost).rollout(p.start)
    P = steady_cost(p.system.A, p.system.B, W, p.control_cost)
    value = np.einsum("ti,ij,tj->t", motion.x, P, motion.x)
    step = np.einsum("ti,ij,tj->t", motion.x[:-1], W, motion.x[:-1])
    step += np.einsum("ti,ij,tj->t", motion.u, p.control_cost, motion.u)
    np.testing.assert_allclose(-np.diff(value), step, rtol=1e-8, atol=1e-8 * value[0])
    assert np.all(np.diff(value) <= 0)
    assert value[-1] < 1e-4 * value[0]


def test_lqr_each_step_has_gain_of_its_weight(rng, stepwise):
    """Equations are solved once per distinct weight, and each step has the gain of its own weight."""
    system, reference = double_integrator(2, 0.1), stepwise(4, 17)
    feedback = lqr(system, reference, 0.4)
    assert 1 < len({W.tobytes() for W in reference.weights[:-1]}) < 16
    for t in range(16):
        single = Reference(reference.targets[t : t + 2], np.stack([reference.weights[t]] * 2))
        np.testing.assert_array_equal(feedback.gains[t], lqr(system, single, 0.4).gains[0])


def test_lqr_constant_target_has_stated_error(rng, random_problem):
    """The remaining error is (I - A + B K)^-1 (A - I) target."""
    p = random_problem(4, 2, 3)
    A, B = p.system.A, p.system.B
    reference = Reference(np.tile(rng.normal(size=4), (300, 1)), np.stack([np.eye(4)] * 300))
    feedback = lqr(p.system, reference, p.control_cost)
    mu, K = reference.targets[0], feedback.gains[0]
    expected = np.linalg.solve(np.eye(4) - A + B @ K, (A - np.eye(4)) @ mu)
    np.testing.assert_allclose(feedback.rollout(p.start).x[-1] - mu, expected, rtol=1e-6, atol=1e-8)


def test_lqr_moving_target_rests_at_stated_offset(rng):
    """A double integrator with target (p, v) rests at p + (K^P)^-1 K^V v; v = 0 is reached."""
    system = double_integrator(2, 0.1)
    p, v = rng.normal(size=(2, 2))
    root = rng.normal(size=(4, 4))
    weights = np.stack([root @ root.T + np.eye(4)] * 400)
    for velocity in (v, np.zeros(2)):
        reference = Reference(np.tile(np.concatenate([p, velocity]), (400, 1)), weights)
        feedback = lqr(system, reference, 1.0)
        offset = np.linalg.solve(feedback.stiffness[0], feedback.damping[0] @ velocity)
        end = feedback.rollout(rng.normal(size=4)).x[-1]
        np.testing.assert_allclose(end, np.concatenate([p + offset, np.zeros(2)]), atol=1e-6)


def test_lqr_later_targets_change_nothing_before(rng, stepwise):
    """Later targets change nothing before they begin, unlike in `track`."""
    system, reference, start = double_integrator(1, 0.1), stepwise(2, 30), rng.normal(size=2)
    later = Reference(np.vstack([reference.targets[:15], reference.targets[15:] + 3]), reference.weights)
    first, second = (lqr(system, r, 1.0).rollout(start) for r in (reference, later))
    np.testing.assert_array_equal(first.x[:16], second.x[:16])
    assert np.abs(first.x[16] - second.x[16]).max() > 1e-6


def test_lqr_weight_without_stabilising_gain_is_refused(rng):
    """Positions without cost, or a state that is not controllable; the message gives the step."""
    mix = rng.normal(size=(4, 4))
    plain = double_integrator(2, 0.1)
    system = LinearSystem(mix @ plain.A @ np.linalg.inv(mix), mix @ plain.B, 0.1)
    velocities = np.linalg.inv(mix).T @ np.diag([0.0, 0.0, 1.0, 1.0]) @ np.linalg.inv(mix)
    weights = np.stack([np.eye(4), 0.5 * (velocities + velocities.T), np.eye(4)])
    with pytest.raises(InvalidInput, match=r"weights\[1\] has no stabilising gain"):
        lqr(system, Reference(np.zeros((3, 4)), weights), 1.0)
    unreached = LinearSystem(np.diag([1.1, 0.5]), np.array([[0.0], [1.0]]), 0.1)
    with pytest.raises(InvalidInput, match=r"weights\[0\] has no stabilising gain"):
        lqr(unreached, Reference(np.zeros((3, 2)), np.stack([np.eye(2)] * 3)), 1.0)


@pytest.mark.parametrize("scale", [1e-45, 1e-30, 1e30, 1e45])
def test_lqr_weight_far_from_control_cost_is_refused(scale):
    """SciPy would warn of an invalid cast and return rounding errors."""
    reference = Reference(np.zeros((3, 4)), np.stack([scale * np.eye(4)] * 3))
    for solve in (
        lambda: lqr(double_integrator(2, 0.1), reference, 1.0),
        lambda: lqr_continuous(continuous_double_integrator(2), reference, 1.0, period=0.1),
    ):
        with pytest.raises(InvalidInput, match=r"weights\[0\] is up to .* and control_cost up to 1"):
            solve()


@pytest.mark.parametrize("scale", [1e-45, 1e-20, 1e20, 1e45])
def test_lqr_scaled_costs_give_same_gain(scale):
    """For any common scale."""
    weights = np.stack([np.eye(4)] * 3)
    expected = lqr(double_integrator(2, 0.1), Reference(np.zeros((3, 4)), weights), 1.0).gains
    found = lqr(double_integrator(2, 0.1), Reference(np.zeros((3, 4)), scale * weights), scale).gains
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e60, 1e300])
def test_lqr_huge_weight_is_refused(scale):
    """Products with it would overflow."""
    reference = Reference(np.zeros((3, 4)), np.stack([scale * np.eye(4)] * 3))
    with pytest.raises(InvalidInput, match=r"weights\[0, 0, 0\] is 1e"):
        lqr(double_integrator(2, 0.1), reference, 1.0)


@pytest.mark.parametrize("power", range(-320, 60, 20))
def test_lqr_weights_of_different_magnitude_give_gain_or_error(power):
    """A warning of SciPy would be an error here."""
    reference = Reference(np.zeros((3, 4)), np.stack([np.diag([1.0, 10.0**power, 1.0, 1.0])] * 3))
    for solve in (
        lambda: lqr(double_integrator(2, 0.1), reference, 1.0).gains,
        lambda: lqr_continuous(continuous_double_integrator(2), reference, 1.0, period=0.1).gains,
    ):
        if power in range(-20, 21, 20):
            assert np.isfinite(solve()).all()
            continue
        with suppress(InvalidInput):
            assert np.isfinite(solve()).all()
