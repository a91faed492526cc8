"""The closed-form LQR of a double integrator against SciPy's Riccati solver."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from pilotfish.assistance.tracking import lqr_gains
from pilotfish.control import double_integrator
from pilotfish.errors import InvalidInput


@pytest.mark.parametrize("period", [0.001, 0.02, 0.1, 1.0])
@pytest.mark.parametrize("control_cost", [1e-4, 0.01, 1.0])
def test_gain_equals_that_of_the_riccati_equation(rng, period, control_cost):
    n = 3
    rotation, _ = np.linalg.qr(rng.normal(size=(n, n)))
    weight = rotation @ np.diag([10.0, 300.0, 1e4]) @ rotation.T
    system = double_integrator(n, period)
    Q, R = np.zeros((2 * n, 2 * n)), control_cost * np.eye(n)
    Q[:n, :n] = weight
    P = solve_discrete_are(system.A, system.B, Q, R)
    expected = np.linalg.solve(R + system.B.T @ P @ system.B, system.B.T @ P @ system.A)
    gains = np.hstack(lqr_gains(weight, control_cost, period))
    assert np.allclose(gains, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_closed_loop_is_stable_for_any_weight(rng):
    for weight in 10.0 ** rng.uniform(-6, 12, 200):
        position, velocity = lqr_gains(np.array([[weight]]), 1.0, 0.01)
        system = double_integrator(1, 0.01)
        closed = system.A - system.B @ np.hstack([position, velocity])
        assert np.abs(np.linalg.eigvals(closed)).max() < 1.0


def test_motion_goes_to_the_mean_whatever_its_variance():
    """The printed tracking does not trade off operator and model: only the time to the mean differs."""
    for variance in (1e-4, 1e2):
        position, velocity = lqr_gains(np.array([[1.0 / variance]]), 1e-3, 0.01)
        x, v = 1.0, 0.0
        for _ in range(20_000):
            u = -position[0, 0] * x - velocity[0, 0] * v
            x, v = x + 0.01 * v + 0.5 * 0.01**2 * u, v + 0.01 * u
        assert abs(x) < 1e-3


def test_control_cost_must_be_positive():
    with pytest.raises(InvalidInput, match="control_cost"):
        lqr_gains(np.eye(2), 0.0, 0.01)
