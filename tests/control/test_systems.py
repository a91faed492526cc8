"""Linear systems: discretisation and double integrators."""

import numpy as np
import pytest
from annotations import check_annotations
from scipy.integrate import solve_ivp

from pilotfish.control import (
    ContinuousSystem,
    continuous_double_integrator,
    discretise,
    double_integrator,
)
from pilotfish.errors import InvalidInput


@pytest.mark.parametrize("axes", [1, 3, 7])
def test_double_integrator_constant_input_moves_as_unit_mass(rng, axes):
    """Under a constant acceleration a, x is p + v t + a t^2 / 2, exactly at every period."""
    system = double_integrator(axes, period=0.07)
    p, v, a = rng.normal(size=(3, axes))
    x = np.concatenate([p, v])
    for t in 0.07 * np.arange(1, 30):
        x = system.A @ x + system.B @ a
        np.testing.assert_allclose(x, np.concatenate([p + v * t + a * t**2 / 2, v + a * t]), atol=1e-12)


@pytest.mark.parametrize("axes", [1, 2, 5])
def test_double_integrator_equals_discretised_continuous_one(axes):
    """The closed form and the matrix exponential agree."""
    closed, exponential = (
        double_integrator(axes, 0.3),
        discretise(continuous_double_integrator(axes), 0.3),
    )
    np.testing.assert_allclose(exponential.A, closed.A, atol=1e-15)
    np.testing.assert_allclose(exponential.B, closed.B, atol=1e-15)
    assert exponential.period == closed.period == 0.3


@pytest.mark.parametrize(("n", "m", "period"), [(1, 1, 0.1), (3, 2, 1.0), (4, 6, 2.5)])
def test_discretise_step_equals_integrated_equation(rng, n, m, period):
    """One step equals the solution of the differential equation after a period."""
    system = ContinuousSystem(rng.normal(size=(n, n)), rng.normal(size=(n, m)))
    x, u = rng.normal(size=n), rng.normal(size=m)
    step = discretise(system, period)
    path = solve_ivp(
        lambda t, x: system.A @ x + system.B @ u, (0, period), x, method="DOP853", rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(step.A @ x + step.B @ u, path.y[:, -1], rtol=1e-9, atol=1e-9)


def test_discretise_two_periods_equal_double_period(rng):
    """An input held for two periods equals one held for twice the period."""
    system = ContinuousSystem(rng.normal(size=(4, 4)), rng.normal(size=(4, 2)))
    short, long = discretise(system, 0.4), discretise(system, 0.8)
    np.testing.assert_allclose(long.A, short.A @ short.A, rtol=1e-11)
    np.testing.assert_allclose(long.B, (short.A + np.eye(4)) @ short.B, rtol=1e-11)


@pytest.mark.parametrize("period", [0.0, -0.1, np.nan, np.inf])
def test_discretise_unusable_period_is_refused(period):
    """The message gives the value."""
    for build in (
        lambda: double_integrator(2, period),
        lambda: discretise(continuous_double_integrator(2), period),
    ):
        with pytest.raises(InvalidInput, match=r"period is .* expected .* a positive time"):
            build()


def test_double_integrator_without_axes_is_refused():
    with pytest.raises(InvalidInput, match="axes is 0, expected a whole number from 1"):
        double_integrator(0, 0.1)
    with pytest.raises(InvalidInput, match="axes is -1, expected a whole number from 1"):
        continuous_double_integrator(-1)


@pytest.mark.parametrize("period", [5e-324, 1e-155, 1e155, 1e300, 10**400, True, "3"])
def test_discretise_extreme_period_is_refused(period):
    """A period whose square is 0 or infinite is refused."""
    for build in (double_integrator, lambda _, period: discretise(continuous_double_integrator(2), period)):
        with check_annotations(False), pytest.raises(InvalidInput, match=r"period is .* a positive time"):
            build(2, period)


@pytest.mark.parametrize("size", [1e16, 1e49, 1e300])
def test_discretise_too_fast_system_is_refused(size):
    """Its matrix exponential is not finite, or has no correct digits."""
    with pytest.raises(InvalidInput, match="expected"):
        discretise(ContinuousSystem(size * np.eye(2), np.ones((2, 1))), 1.0)
    with pytest.raises(InvalidInput, match="overflows float64"):
        discretise(ContinuousSystem(1e3 * np.eye(2), np.ones((2, 1))), 1.0)
    decayed = discretise(ContinuousSystem(-1e3 * np.eye(2), np.ones((2, 1))), 1.0)
    np.testing.assert_allclose(decayed.A, np.zeros((2, 2)), atol=1e-300)
    np.testing.assert_allclose(decayed.B, 1e-3)
