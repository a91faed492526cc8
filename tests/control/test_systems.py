"""Laws of the linear systems."""

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
def test_a_double_integrator_moves_as_a_unit_mass(rng, axes):
    """Under a constant push a it goes p + v t + a t^2 / 2 and gains a t, exactly at every period."""
    system = double_integrator(axes, period=0.07)
    p, v, a = rng.normal(size=(3, axes))
    x = np.concatenate([p, v])
    for t in 0.07 * np.arange(1, 30):
        x = system.A @ x + system.B @ a
        np.testing.assert_allclose(x, np.concatenate([p + v * t + a * t**2 / 2, v + a * t]), atol=1e-12)


@pytest.mark.parametrize("axes", [1, 2, 5])
def test_the_discrete_double_integrator_is_the_continuous_one_discretised(axes):
    """The closed form and the matrix exponential are two ways to one system."""
    closed, exponential = (
        double_integrator(axes, 0.3),
        discretise(continuous_double_integrator(axes), 0.3),
    )
    np.testing.assert_allclose(exponential.A, closed.A, atol=1e-15)
    np.testing.assert_allclose(exponential.B, closed.B, atol=1e-15)
    assert exponential.period == closed.period == 0.3


@pytest.mark.parametrize(("n", "m", "period"), [(1, 1, 0.1), (3, 2, 1.0), (4, 6, 2.5)])
def test_discretising_is_exact_while_the_input_is_held(rng, n, m, period):
    """One step of the discrete system is the solution of the differential equation after a period."""
    system = ContinuousSystem(rng.normal(size=(n, n)), rng.normal(size=(n, m)))
    x, u = rng.normal(size=n), rng.normal(size=m)
    step = discretise(system, period)
    path = solve_ivp(
        lambda t, x: system.A @ x + system.B @ u, (0, period), x, method="DOP853", rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(step.A @ x + step.B @ u, path.y[:, -1], rtol=1e-9, atol=1e-9)


def test_two_short_periods_make_a_long_one(rng):
    """Holding an input for twice the period is holding it twice."""
    system = ContinuousSystem(rng.normal(size=(4, 4)), rng.normal(size=(4, 2)))
    short, long = discretise(system, 0.4), discretise(system, 0.8)
    np.testing.assert_allclose(long.A, short.A @ short.A, rtol=1e-11)
    np.testing.assert_allclose(long.B, (short.A + np.eye(4)) @ short.B, rtol=1e-11)


@pytest.mark.parametrize("period", [0.0, -0.1, np.nan, np.inf])
def test_a_period_that_is_no_positive_time_is_refused(period):
    """Neither system is built, and the message gives the value."""
    for build in (
        lambda: double_integrator(2, period),
        lambda: discretise(continuous_double_integrator(2), period),
    ):
        with pytest.raises(InvalidInput, match=r"period is .* expected .* a positive time"):
            build()


def test_a_double_integrator_without_axes_is_refused():
    with pytest.raises(InvalidInput, match="axes is 0, expected a whole number from 1"):
        double_integrator(0, 0.1)
    with pytest.raises(InvalidInput, match="axes is -1, expected a whole number from 1"):
        continuous_double_integrator(-1)


@pytest.mark.parametrize("period", [5e-324, 1e-155, 1e155, 1e300, 10**400, True, "3"])
def test_period_whose_square_is_lost_is_refused(period):
    """Rather than squared to 0 or infinity."""
    for build in (double_integrator, lambda _, period: discretise(continuous_double_integrator(2), period)):
        with check_annotations(False), pytest.raises(InvalidInput, match=r"period is .* a positive time"):
            build(2, period)


@pytest.mark.parametrize("size", [1e16, 1e49, 1e300])
def test_system_too_fast_for_its_period_is_not_discretised(size):
    """Its matrix exponential is not finite, or has no right digits."""
    with pytest.raises(InvalidInput, match="expected"):
        discretise(ContinuousSystem(size * np.eye(2), np.ones((2, 1))), 1.0)
    with pytest.raises(InvalidInput, match="outgrows"):
        discretise(ContinuousSystem(1e3 * np.eye(2), np.ones((2, 1))), 1.0)
    decayed = discretise(ContinuousSystem(-1e3 * np.eye(2), np.ones((2, 1))), 1.0)
    np.testing.assert_allclose(decayed.A, np.zeros((2, 2)), atol=1e-300)
    np.testing.assert_allclose(decayed.B, 1e-3)
