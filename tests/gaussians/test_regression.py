"""Regression with mixtures."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import pilotfish.gaussians.regression as regression
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import (
    Gaussian,
    GaussianMixture,
    condition,
    conditional_gaussians,
    log_density,
    log_input_densities,
    marginal,
    regress,
    regress_means,
    regress_with_responsibilities,
)


def random_mixture(rng, K, D):
    A = rng.normal(size=(K, D, D))
    return GaussianMixture(
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


@pytest.mark.parametrize("distance", [1e4, 1e9, 1e100])
def test_far_from_all_components_the_widest_predicts_alone(rng, distance):
    """Shares are computed in logarithms: no distance makes them nothing over nothing."""
    mixture, inputs = random_mixture(rng, 3, 3), np.array([0])
    x = np.array([[distance], [-distance]])
    widest = int(mixture.covariances[:, 0, 0].argmax())
    result = regress(mixture, inputs, x)
    for n in range(2):
        alone = condition(Gaussian(mixture.means[widest], mixture.covariances[widest]), inputs, x[n])
        np.testing.assert_allclose(result.means[n], alone.mean, rtol=1e-9)
        np.testing.assert_allclose(result.covariances[n], alone.covariance, rtol=1e-9)
    slope = mixture.covariances[widest, 1:, :1] / mixture.covariances[widest, 0, 0]
    np.testing.assert_allclose(result.jacobians, np.stack([slope, slope]), rtol=1e-9)


def test_far_away_two_parallel_components_leave_their_slope(rng):
    """Components that differ in the outputs alone keep their shares everywhere: only the slope is left."""
    one = random_mixture(rng, 1, 3)
    means = np.stack([one.means[0], one.means[0] + [0.0, 1.0, -2.0]])
    pair = GaussianMixture(np.array([0.3, 0.7]), means, np.repeat(one.covariances, 2, axis=0))
    slope = one.covariances[0, 1:, :1] / one.covariances[0, 0, 0]
    told = regress(pair, np.array([0]), np.array([[1e9]]))
    np.testing.assert_allclose(told.jacobians[0], slope, rtol=1e-6)
    within = condition(Gaussian(one.means[0], one.covariances[0]), np.array([0]), np.zeros(1)).covariance
    between = 0.3 * 0.7 * np.outer([1.0, -2.0], [1.0, -2.0])
    np.testing.assert_allclose(told.covariances[0], within + between, rtol=1e-4, atol=1e-5)


def test_a_component_of_no_weight_has_no_influence(rng):
    """Also where it alone would explain the input."""
    mixture = random_mixture(rng, 2, 3)
    mixture.means[1] += 1e3
    silent = GaussianMixture(np.array([1.0, 0.0]), mixture.means, mixture.covariances)
    alone = GaussianMixture(np.ones(1), mixture.means[:1], mixture.covariances[:1])
    x, inputs = mixture.means[1:, :1], np.array([0])
    told, expected = regress(silent, inputs, x), regress(alone, inputs, x)
    np.testing.assert_allclose(told.means, expected.means)
    np.testing.assert_allclose(told.jacobians, expected.jacobians)


def test_input_densities_are_those_of_the_marginals(rng):
    mixture, inputs, x = random_mixture(rng, 3, 5), np.array([3, 0]), rng.normal(size=(4, 2))
    found = log_input_densities(conditional_gaussians(mixture.means, mixture.covariances, inputs), x)
    for k in range(3):
        own = marginal(Gaussian(mixture.means[k], mixture.covariances[k]), inputs)
        np.testing.assert_allclose(found[:, k], log_density(own, x))


def test_many_inputs_are_answered_one_by_one(rng, monkeypatch):
    """Rows are worked on in blocks; where these are cut changes nothing, and no row is an answer to none."""
    mixture, inputs, x = random_mixture(rng, 3, 4), np.array([1]), rng.normal(size=(7, 1))
    monkeypatch.setattr(regression, "MAX_ARRAY_SIZE", 2 * 3 * 3)  # two rows a block
    together = regress(mixture, inputs, x)
    for n in range(7):
        alone = regress(mixture, inputs, x[n : n + 1])
        np.testing.assert_allclose(together.means[n], alone.means[0])
        np.testing.assert_allclose(together.covariances[n], alone.covariances[0])
        np.testing.assert_allclose(together.jacobians[n], alone.jacobians[0])
    np.testing.assert_allclose(regress_means(mixture, inputs, x), together.means)
    assert regress(mixture, inputs, x[:0]).covariances.shape == (0, 3, 3)
    assert regress_means(mixture, inputs, x[:0]).shape == (0, 3)


def test_units_and_the_order_of_inputs_do_not_matter(rng):
    """Columns in other units, inputs named in another order: the same answer in those units."""
    mixture, x = random_mixture(rng, 3, 4), rng.normal(size=(5, 2))
    units = 10.0 ** rng.uniform(-3, 3, size=4)
    scaled = GaussianMixture(
        mixture.weights, units * mixture.means, np.outer(units, units) * mixture.covariances
    )
    plain = regress(mixture, np.array([0, 2]), x)
    other = regress(scaled, np.array([2, 0]), (x * units[[0, 2]])[:, ::-1])
    out = units[[1, 3]]
    np.testing.assert_allclose(other.means, out * plain.means, rtol=1e-7)
    np.testing.assert_allclose(other.covariances, np.outer(out, out) * plain.covariances, rtol=1e-6)
    jacobians = out[:, None] * plain.jacobians[:, :, ::-1] / units[[2, 0]]
    np.testing.assert_allclose(other.jacobians, jacobians, rtol=1e-6, atol=1e-12)


def test_a_component_that_has_the_whole_share_predicts_alone(rng):
    """Shares may come from elsewhere, say from a chain."""
    mixture, inputs, x = random_mixture(rng, 3, 4), np.array([1, 2]), rng.normal(size=(3, 2))
    conditionals = conditional_gaussians(mixture.means, mixture.covariances, inputs)
    result = regress_with_responsibilities(conditionals, x, np.eye(3))
    for k in range(3):
        alone = condition(Gaussian(mixture.means[k], mixture.covariances[k]), inputs, x[k])
        np.testing.assert_allclose(result.means[k], alone.mean)
        np.testing.assert_allclose(result.covariances[k], alone.covariance, rtol=1e-9)
        np.testing.assert_allclose(result.jacobians[k], conditionals.slopes[k])


def test_inputs_that_cannot_be_used_are_refused(rng):
    mixture, inputs = random_mixture(rng, 2, 3), np.array([0, 2])
    with pytest.raises(InvalidInput, match="3 columns, expected 2"):
        regress(mixture, inputs, np.zeros((4, 3)))
    x = np.zeros((4, 2))
    x[2, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"x\[2, 1\] is nan.*leave out the row"):
        regress(mixture, inputs, x)
    with pytest.raises(InvalidInput, match=r"expected finite numbers of at most 1e\+150"):
        regress(mixture, inputs, np.array([[0.0, 0.0], [1e200, 0.0]]))
    with pytest.raises(InvalidInput, match="name one twice"):
        regress(mixture, np.array([0, -3]), x)


def test_inputs_must_leave_something_to_predict(rng):
    with pytest.raises(InvalidInput, match="at least one input and one output"):
        regress(random_mixture(rng, 2, 2), np.array([0, 1]), np.zeros((1, 2)))
    with pytest.raises(InvalidInput, match="at least one input and one output"):
        regress(random_mixture(rng, 2, 2), np.array([], dtype=int), np.zeros((1, 0)))


def test_a_component_that_is_singular_in_the_inputs_is_named(rng):
    singular = GaussianMixture(np.ones(1), np.zeros((1, 3)), np.diag([0.0, 1.0, 1.0])[None])
    with pytest.raises(NotPositiveDefinite, match="component 0"):
        regress(singular, np.array([0]), np.zeros((1, 1)))
