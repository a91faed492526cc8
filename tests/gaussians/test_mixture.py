"""Regression with mixtures."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import Gaussian, Mixture, condition, regress


def random_mixture(rng, K, D):
    A = rng.normal(size=(K, D, D))
    return Mixture(
        rng.dirichlet(np.ones(K)), 2 * rng.normal(size=(K, D)), A @ A.transpose(0, 2, 1) + 0.1 * np.eye(D)
    )


def test_regression_agrees_with_numerical_integration_of_the_joint_density(rng):
    """E[y | x] and Var[y | x] by sums over a fine grid of y."""
    mixture = random_mixture(rng, 3, 2)
    x = np.array([[0.3], [-1.2]])
    result = regress(mixture, np.array([0]), x)
    y = np.linspace(-25.0, 25.0, 50_001)
    for n in range(2):
        points = np.stack([np.full_like(y, x[n, 0]), y], axis=1)
        components = zip(mixture.weights, mixture.means, mixture.covariances, strict=True)
        density = sum(w * multivariate_normal(m, S).pdf(points) for w, m, S in components)
        mean = (density @ y) / density.sum()
        np.testing.assert_allclose(result.means[n, 0], mean, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(
            result.covariances[n, 0, 0], density @ (y - mean) ** 2 / density.sum(), rtol=1e-6
        )


@pytest.mark.parametrize("K", [1, 4])
def test_the_jacobian_is_the_finite_difference_of_the_mean(rng, K):
    mixture, inputs, x = random_mixture(rng, K, 5), np.array([1, 3]), rng.normal(size=(4, 2))
    exact = regress(mixture, inputs, x).jacobians
    for i in range(2):
        step = 1e-5 * np.eye(2)[i]
        slope = (regress(mixture, inputs, x + step).means - regress(mixture, inputs, x - step).means) / 2e-5
        np.testing.assert_allclose(exact[:, :, i], slope, rtol=1e-5, atol=1e-7)


def test_one_component_regresses_to_its_conditional(rng):
    mixture, inputs, x = random_mixture(rng, 1, 4), np.array([2, 0]), rng.normal(size=2)
    known = condition(Gaussian(mixture.means[0], mixture.covariances[0]), inputs, x)
    result = regress(mixture, inputs, x[None])
    np.testing.assert_allclose(result.means[0], known.mean)
    np.testing.assert_allclose(result.covariances[0], known.covariance)


def test_far_from_all_components_the_answer_is_finite(rng):
    result = regress(random_mixture(rng, 3, 3), np.array([0]), np.array([[1e4]]))
    assert np.isfinite(result.means).all()
    assert np.isfinite(result.jacobians).all()


def test_inputs_must_leave_something_to_predict(rng):
    with pytest.raises(InvalidInput, match="nothing to map"):
        regress(random_mixture(rng, 2, 2), np.array([0, 1]), np.zeros((1, 2)))


def test_a_component_that_is_singular_in_the_inputs_is_named(rng):
    singular = Mixture(np.ones(1), np.zeros((1, 3)), np.diag([0.0, 1.0, 1.0])[None])
    with pytest.raises(NotPositiveDefinite, match="component 0"):
        regress(singular, np.array([0]), np.zeros((1, 1)))
