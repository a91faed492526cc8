"""LQT and LQR in continuous time."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pilotfish.control import (
    ContinuousSystem,
    Reference,
    continuous_double_integrator,
    discretise,
    lqr_continuous,
    track,
    track_continuous,
)
from pilotfish.control.continuous import hamiltonian_flow
from pilotfish.errors import InvalidInput

TOLERANCES = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}


def random_system(rng: np.random.Generator, n: int, m: int) -> ContinuousSystem:
    return ContinuousSystem(rng.normal(size=(n, n)), rng.normal(size=(n, m)))


def integrate_backward(
    system: ContinuousSystem, reference: Reference, R: np.ndarray, period: float, end: np.ndarray
):
    """Integrate P and d of equations 3.45 and 3.46 backward with a general integrator.

    Inside a period the target mu is constant. Where it jumps back by j, d jumps by P j.
    """
    A, G, n = system.A, system.B @ np.linalg.solve(R, system.B.T), len(system.A)
    P, d, next_target, solution = end, np.zeros(n), reference.targets[-1], []
    for Q, mu in zip(reference.weights[-2::-1], reference.targets[-2::-1], strict=True):

        def slope(_, y, Q=Q, mu=mu):
            P, d = y[: n * n].reshape(n, n), y[n * n :]
            return np.append(A.T @ P + P @ A - P @ G @ P + Q, A.T @ d - P @ G @ d - P @ A @ mu)

        y = solve_ivp(slope, (0, period), np.append(P, d + P @ (next_target - mu)), **TOLERANCES).y[:, -1]
        P, d, next_target = y[: n * n].reshape(n, n), y[n * n :], mu
        solution.append((P, d))
    return solution[::-1]


@pytest.mark.parametrize("last", [0.0, 2.0])
@pytest.mark.parametrize(
    ("n", "m", "T", "period"), [(1, 1, 2, 0.5), (2, 1, 5, 0.1), (3, 4, 4, 0.3), (4, 2, 6, 1.0)]
)
def test_track_continuous_gains_equal_integrated_riccati_equation(rng, stepwise, n, m, T, period, last):
    """Equation 3.45 with P and d of 3.46; terminal weight zero or positive."""
    system, reference = random_system(rng, n, m), stepwise(n, T)
    root = rng.normal(size=(m, m))
    R, end = root @ root.T + 0.1 * np.eye(m), last * np.eye(n)
    feedback = track_continuous(system, reference, R, period=period, terminal=end if last else None)
    for t, (P, d) in enumerate(integrate_backward(system, reference, R, period, end)):
        np.testing.assert_allclose(
            feedback.gains[t], np.linalg.solve(R, system.B.T @ P), rtol=1e-7, atol=1e-9
        )
        np.testing.assert_allclose(
            feedback.feedforwards[t], np.linalg.solve(R, system.B.T @ d), rtol=1e-7, atol=1e-8
        )


def test_rollout_equals_integrated_closed_loop(rng, stepwise):
    """The state follows dx/dt = A x + B u with u of equation 3.45, P and d at every moment."""
    system, reference, R, period = random_system(rng, 3, 2), stepwise(3, 6), 0.5 * np.eye(2), 0.2
    G = system.B @ system.B.T / 0.5
    feedback = track_continuous(system, reference, R, period=period)
    motion = feedback.rollout(rng.normal(size=3))
    values = integrate_backward(system, reference, R, period, np.zeros((3, 3)))
    for t in range(5):
        (P, d), mu, Q = values[t], reference.targets[t], reference.weights[t]

        def slope(_, y, Q=Q, mu=mu):  # x, P and d, forward
            x, P, d = y[:3], y[3:12].reshape(3, 3), y[12:]
            x_slope = system.A @ x - G @ (P @ (x - mu) - d)
            P_slope = -(system.A.T @ P + P @ system.A - P @ G @ P + Q)
            d_slope = -(system.A.T @ d - P @ G @ d - P @ system.A @ mu)
            return np.concatenate([x_slope, P_slope.ravel(), d_slope])

        y = solve_ivp(slope, (0, period), np.concatenate([motion.x[t], P.ravel(), d]), **TOLERANCES).y[:, -1]
        np.testing.assert_allclose(motion.x[t + 1], y[:3], rtol=1e-7, atol=1e-7)


def test_track_continuous_halved_periods_give_same_motion(rng, stepwise):
    """A target held for two half periods gives the motion of one period."""
    system, reference, start = random_system(rng, 4, 2), stepwise(4, 10), rng.normal(size=4)
    whole = track_continuous(system, reference, 0.3, period=0.4, terminal=np.eye(4))
    halves = Reference(*(np.repeat(a, 2, axis=0)[:-1] for a in (reference.targets, reference.weights)))
    halved = track_continuous(system, halves, 0.3, period=0.2, terminal=np.eye(4))
    np.testing.assert_allclose(halved.gains[::2], whole.gains, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(halved.rollout(start).x[::2], whole.rollout(start).x, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(halved.rollout(start).u[::2], whole.rollout(start).u, rtol=1e-9, atol=1e-9)


def test_track_short_periods_converge_to_track_continuous(rng, stepwise):
    """With costs times a shrinking period, the error of the discrete motion is proportional to the period."""
    system, reference, start = continuous_double_integrator(2), stepwise(4, 7), rng.normal(size=4)
    exact = track_continuous(system, reference, 0.5, period=0.4).rollout(start).x
    errors = []
    for parts in (20, 40):
        short = 0.4 / parts
        targets, weights = (np.repeat(a[:-1], parts, axis=0) for a in (reference.targets, reference.weights))
        last = np.zeros((1, 4, 4))  # the last state has no weight
        fine = Reference(np.vstack([targets, targets[-1:]]), np.concatenate([short * weights, last]))
        motion = track(discretise(system, short), fine, 0.5 * short).rollout(start)
        errors.append(np.abs(motion.x[::parts] - exact).max())
    assert errors[1] < 0.03 * np.abs(exact).max()
    assert 1.8 < errors[0] / errors[1] < 2.2


def test_track_continuous_terminal_weight_reaches_last_target(rng):
    """With no other weight, a large terminal weight is reached, and zero leaves the mass free."""
    reference = Reference(rng.normal(size=(5, 4)), np.zeros((5, 4, 4)))
    system, start = continuous_double_integrator(2), rng.normal(size=4)
    attracted = track_continuous(system, reference, 1.0, period=0.5, terminal=1e7 * np.eye(4)).rollout(start)
    np.testing.assert_allclose(attracted.x[-1], reference.targets[-1], atol=1e-5)
    free = track_continuous(system, reference, 1.0, period=0.5).rollout(start)
    np.testing.assert_allclose(free.u, 0, atol=1e-12)
    np.testing.assert_allclose(free.x[-1, :2], start[:2] + 2.0 * start[2:], atol=1e-12)


def test_track_continuous_long_horizon_gains_stabilise(rng):
    """P stays symmetric and positive semidefinite, so that the gains are stabilising."""
    system = random_system(rng, 4, 2)
    weights = np.stack([np.diag([1e3, 1e-2, 0.0, 1.0])] * 60)
    feedback = track_continuous(system, Reference(np.zeros((60, 4)), weights), 1e-2, period=0.5)
    assert np.linalg.eigvals(system.A - system.B @ feedback.gains[0]).real.max() < 0
    assert np.abs(np.linalg.eigvals(feedback.closed_loops[0, :, :-1])).max() < 1


def test_continuous_feedback_transformed_world_transforms_motion(rng, stepwise):
    """A translation by a kilometre and a rotation of start and reference transform the motion."""
    system, reference, start = continuous_double_integrator(3), stepwise(6, 12), rng.normal(size=6)
    turn = np.kron(np.eye(2), np.linalg.qr(rng.normal(size=(3, 3)))[0])
    shift = np.array([1e3, -1e3, 1e3, 0, 0, 0])
    moved = Reference(reference.targets @ turn.T + shift, turn @ reference.weights @ turn.T)
    for control in (track_continuous, lqr_continuous):
        motion = control(system, reference, 0.3, period=0.2).rollout(start)
        transformed = control(system, moved, 0.3, period=0.2).rollout(turn @ start + shift)
        np.testing.assert_allclose(transformed.x, motion.x @ turn.T + shift, rtol=0, atol=1e-8)


def test_track_continuous_input_equals_stiffness_damping_and_feedforward(rng, stepwise):
    """Equation 3.45: u = K^P (target - x) of positions + K^V (target - x) of velocities + feedforward."""
    feedback = track_continuous(continuous_double_integrator(2), stepwise(4, 9), 0.1, period=0.2)
    assert feedback.stiffness.shape == feedback.damping.shape == (8, 2, 2)
    motion = feedback.rollout(rng.normal(size=4))
    for t in range(8):
        error = feedback.reference.targets[t] - motion.x[t]
        u = feedback.stiffness[t] @ error[:2] + feedback.damping[t] @ error[2:] + feedback.feedforwards[t]
        np.testing.assert_allclose(u, motion.u[t], rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(feedback.command(t, motion.x[t]), motion.u[t])


def steady_cost(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return P of the algebraic Riccati equation from the stable eigenvectors of the Hamiltonian matrix.

    Source:
        Tanwani 2018, equations 3.48-3.49; the decomposition is V L V^-1, where it prints V L V^T.
    """
    n = len(A)
    values, V = np.linalg.eig(np.block([[A, -B @ np.linalg.inv(R) @ B.T], [-Q, -A.T]]))
    stable = V[:, values.real < 0]
    assert stable.shape[1] == n
    return np.real(stable[n:] @ np.linalg.inv(stable[:n]))


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (4, 2), (3, 5), (10, 4)])
def test_lqr_continuous_gains_equal_hamiltonian_eigenvector_solution(rng, n, m):
    """SciPy's solver and the corrected construction of the thesis give the same stabilising gain."""
    system, root = random_system(rng, n, m), rng.normal(size=(n, n))
    W, R = root @ root.T + np.eye(n), np.diag(rng.uniform(0.5, 2.0, size=m))
    reference = Reference(rng.normal(size=(3, n)), np.stack([W] * 3))
    feedback = lqr_continuous(system, reference, R, period=0.1)
    expected = np.linalg.solve(R, system.B.T @ steady_cost(system.A, system.B, W, R))
    np.testing.assert_allclose(feedback.gains, [expected] * 2, rtol=1e-7, atol=1e-7)
    np.testing.assert_array_equal(feedback.feedforwards, 0)
    assert np.linalg.eigvals(system.A - system.B @ feedback.gains[0]).real.max() < 0


@pytest.mark.parametrize("period", [0.5, 50.0])
def test_track_continuous_long_horizon_equals_lqr_continuous(rng, period):
    """The gains equal those of the infinite horizon, for short and for long periods."""
    system, root = continuous_double_integrator(2), rng.normal(size=(4, 4))
    T = 1 + int(np.ceil(50 / period))
    reference = Reference(np.zeros((T, 4)), np.stack([root @ root.T + np.eye(4)] * T))
    finite = track_continuous(system, reference, 0.7, period=period)
    infinite = lqr_continuous(system, reference, 0.7, period=period)
    np.testing.assert_allclose(finite.gains[0], infinite.gains[0], rtol=1e-8, atol=1e-8)


def test_lqr_continuous_rollout_equals_integrated_closed_loop(rng, stepwise):
    """Between two steps the state follows dx/dt = A x - B K (x - target)."""
    system, reference = random_system(rng, 3, 2), stepwise(3, 8)
    feedback = lqr_continuous(system, reference, 0.5, period=0.3)
    motion = feedback.rollout(rng.normal(size=3))
    for t in range(7):
        loop, mu = system.B @ feedback.gains[t], reference.targets[t]
        y = solve_ivp(
            lambda _, x, loop=loop, mu=mu: system.A @ x - loop @ (x - mu), (0, 0.3), motion.x[t], **TOLERANCES
        )
        np.testing.assert_allclose(motion.x[t + 1], y.y[:, -1], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(motion.u[t], -feedback.gains[t] @ (motion.x[t] - mu), atol=1e-12)


def test_lqr_continuous_constant_target_has_stated_error(rng):
    """The remaining error is (B K - A)^-1 A target; an equilibrium is reached."""
    system, weights = continuous_double_integrator(2), np.stack([np.eye(4)] * 200)
    for mu in (rng.normal(size=4), np.append(rng.normal(size=2), [0, 0])):
        feedback = lqr_continuous(system, Reference(np.tile(mu, (200, 1)), weights), 0.5, period=0.2)
        expected = np.linalg.solve(system.B @ feedback.gains[0] - system.A, system.A @ mu)
        np.testing.assert_allclose(feedback.rollout(rng.normal(size=4)).x[-1] - mu, expected, atol=1e-9)


def test_lqr_continuous_weight_without_stabilising_gain_is_refused():
    """Only velocities have a weight, so that positions may drift; the message gives the step."""
    weights = np.stack([np.eye(4), np.diag([0.0, 0.0, 1.0, 1.0]), np.eye(4)])
    with pytest.raises(InvalidInput, match=r"weights\[1\] has no stabilising gain"):
        lqr_continuous(continuous_double_integrator(2), Reference(np.zeros((3, 4)), weights), 1.0, period=0.1)


@pytest.mark.parametrize("time", [1e-3, 1.0, 30.0])
def test_hamiltonian_flow_two_periods_equal_double_period(rng, time):
    """Elimination of the costate between two periods gives the flow of both, with symmetric G and Q."""
    n = 3
    A, roots = rng.normal(size=(n, n)), rng.normal(size=(2, n, n))
    G, Q = roots @ np.swapaxes(roots, 1, 2)
    (A1, G1, Q1), (A2, G2, Q2) = hamiltonian_flow(A, G, Q, time), hamiltonian_flow(A, G, Q, 2 * time)
    x, after = rng.normal(size=(2, n))
    middle = np.linalg.solve(np.eye(n) + G1 @ Q1, A1 @ x - G1 @ A1.T @ after)
    costate = Q1 @ middle + A1.T @ after
    np.testing.assert_allclose(A2 @ x - G2 @ after, A1 @ middle - G1 @ after, rtol=1e-8)
    np.testing.assert_allclose(Q2 @ x + A2.T @ after, Q1 @ x + A1.T @ costate, rtol=1e-8)
    for symmetric in (G2, Q2):
        np.testing.assert_allclose(symmetric, symmetric.T, atol=1e-9 * np.abs(symmetric).max())
