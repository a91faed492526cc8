"""Laws of the infinite horizon in discrete time."""

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
    """P of the discrete algebraic Riccati equation from the stable eigenvectors of the symplectic matrix.

    Source: the thesis, equation 3.55, the sign of whose upper right block is mended.
    """
    n, G, inverse = len(A), B @ np.linalg.inv(R) @ B.T, np.linalg.inv(A).T
    symplectic = np.block([[A + G @ inverse @ Q, -G @ inverse], [-inverse @ Q, inverse]])
    values, vectors = np.linalg.eig(symplectic)
    stable = vectors[:, np.abs(values) < 1]
    assert stable.shape[1] == n
    return np.real(stable[n:] @ np.linalg.inv(stable[:n]))


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (4, 2), (3, 5), (14, 7)])
def test_gains_agree_with_the_eigenvectors_of_the_symplectic_matrix(rng, random_problem, n, m):
    """SciPy's solver and the thesis' construction, mended, give one gain."""
    p = random_problem(n, m, 3)
    A, B, R = p.system.A, p.system.B, p.control_cost
    W = np.eye(n) + p.reference.weights[0]
    P = steady_cost(A, B, W, R)
    feedback = lqr(p.system, Reference(p.reference.targets, np.stack([W] * 3)), R)
    expected = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    np.testing.assert_allclose(feedback.gains, [expected] * 2, rtol=1e-7, atol=1e-7)
    np.testing.assert_array_equal(feedback.feedforwards, 0)


@pytest.mark.parametrize(("n", "m"), [(2, 1), (4, 2), (3, 5)])
def test_gains_of_a_long_horizon_settle_at_those_of_the_infinite_one(random_problem, n, m):
    """Far from its end, a finite horizon knows of no end."""
    p = random_problem(n, m, 3)
    W = np.eye(n) + p.reference.weights[0]
    reference = Reference(np.zeros((300, n)), np.stack([W] * 300))
    finite, infinite = track(p.system, reference, p.control_cost), lqr(p.system, reference, p.control_cost)
    np.testing.assert_allclose(finite.gains[0], infinite.gains[0], rtol=1e-9, atol=1e-9)
    assert np.abs(finite.gains[-1] - infinite.gains[-1]).max() > 1e-4


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (4, 2), (3, 5)])
def test_each_gain_stabilises(random_problem, n, m):
    """No difference from a target at rest grows, whatever its weight, in a system that explodes by itself."""
    p = random_problem(n, m, 6)
    system = LinearSystem(1.3 * p.system.A, p.system.B, 0.1)
    reference = Reference(p.reference.targets, p.reference.weights + 0.1 * np.eye(n))
    for K in lqr(system, reference, p.control_cost).gains:
        assert np.abs(np.linalg.eigvals(system.A - system.B @ K)).max() < 1


def test_the_value_falls_by_what_the_step_costs(random_problem):
    """e^T P e is the price of all that remains: it pays for each step, down to nothing."""
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


def test_each_step_has_the_gain_of_its_own_weight(rng, stepwise):
    """Few equations are solved, and each step gets the solution of its own."""
    system, reference = double_integrator(2, 0.1), stepwise(4, 17)
    feedback = lqr(system, reference, 0.4)
    assert 1 < len({W.tobytes() for W in reference.weights[:-1]}) < 16
    for t in range(16):
        alone = Reference(reference.targets[t : t + 2], np.stack([reference.weights[t]] * 2))
        np.testing.assert_array_equal(feedback.gains[t], lqr(system, alone, 0.4).gains[0])


def test_a_target_at_rest_is_reached_and_any_other_missed_by_the_stated_error(rng, random_problem):
    """The error that remains is (I - A + B K)^-1 (A - I) target."""
    p = random_problem(4, 2, 3)
    A, B = p.system.A, p.system.B
    reference = Reference(np.tile(rng.normal(size=4), (300, 1)), np.stack([np.eye(4)] * 300))
    feedback = lqr(p.system, reference, p.control_cost)
    mu, K = reference.targets[0], feedback.gains[0]
    expected = np.linalg.solve(np.eye(4) - A + B @ K, (A - np.eye(4)) @ mu)
    np.testing.assert_allclose(feedback.rollout(p.start).x[-1] - mu, expected, rtol=1e-6, atol=1e-8)


def test_a_moving_target_is_overshot_by_damping_over_stiffness(rng):
    """A double integrator asked to be at p with velocity v rests at p + (K^P)^-1 K^V v; v = 0 is reached."""
    system = double_integrator(2, 0.1)
    p, v = rng.normal(size=(2, 2))
    root = rng.normal(size=(4, 4))
    weights = np.stack([root @ root.T + np.eye(4)] * 400)
    for velocity in (v, np.zeros(2)):
        reference = Reference(np.tile(np.concatenate([p, velocity]), (400, 1)), weights)
        feedback = lqr(system, reference, 1.0)
        past = np.linalg.solve(feedback.stiffness[0], feedback.damping[0] @ velocity)
        end = feedback.rollout(rng.normal(size=4)).x[-1]
        np.testing.assert_allclose(end, np.concatenate([p + past, np.zeros(2)]), atol=1e-6)


def test_regulation_does_not_look_ahead(rng, stepwise):
    """What comes later changes nothing now, unlike in tracking."""
    system, reference, start = double_integrator(1, 0.1), stepwise(2, 30), rng.normal(size=2)
    later = Reference(np.vstack([reference.targets[:15], reference.targets[15:] + 3]), reference.weights)
    one, other = (lqr(system, r, 1.0).rollout(start) for r in (reference, later))
    np.testing.assert_array_equal(one.x[:16], other.x[:16])
    assert np.abs(one.x[16] - other.x[16]).max() > 1e-6


def test_a_weight_without_a_stabilising_gain_is_refused(rng):
    """Positions without price, in any coordinates, or a state out of reach; the message names the step."""
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
def test_weight_too_far_from_the_effort_is_refused_before_the_solver(scale):
    """SciPy would warn of an invalid cast, and give a gain of rounding errors."""
    reference = Reference(np.zeros((3, 4)), np.stack([scale * np.eye(4)] * 3))
    for solve in (
        lambda: lqr(double_integrator(2, 0.1), reference, 1.0),
        lambda: lqr_continuous(continuous_double_integrator(2), reference, 1.0, period=0.1),
    ):
        with pytest.raises(InvalidInput, match=r"weights\[0\] is up to .* and control_cost up to 1"):
            solve()


@pytest.mark.parametrize("scale", [1e-45, 1e-20, 1e20, 1e45])
def test_gain_depends_on_the_ratio_of_weight_and_effort_only(scale):
    """However large both are."""
    weights = np.stack([np.eye(4)] * 3)
    expected = lqr(double_integrator(2, 0.1), Reference(np.zeros((3, 4)), weights), 1.0).gains
    found = lqr(double_integrator(2, 0.1), Reference(np.zeros((3, 4)), scale * weights), scale).gains
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e60, 1e300])
def test_weight_beyond_all_use_is_refused(scale):
    """Products of it would overflow."""
    reference = Reference(np.zeros((3, 4)), np.stack([scale * np.eye(4)] * 3))
    with pytest.raises(InvalidInput, match=r"weights\[0, 0, 0\] is 1e"):
        lqr(double_integrator(2, 0.1), reference, 1.0)


@pytest.mark.parametrize("power", range(-320, 60, 20))
def test_weights_of_columns_far_apart_give_a_gain_or_a_refusal(power):
    """Whatever SciPy says of it, as a warning would be an error here."""
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
