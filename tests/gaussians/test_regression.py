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
    marginal,
    regress_with_responsibilities,
)


def random_mixture(rng, K, D):
    A = rng.normal(size=(K, D, D))
    return GaussianMixture(
        rng.dirichlet(np.ones(K)), 2 * rng.normal(size=(K, D)), A @ A.transpose(0, 2, 1) + 0.1 * np.eye(D)
    )


def test_regress_equals_numerical_integration(rng):
    """Compare E[y | x] and Var[y | x] by sums over a fine grid of y."""
    mixture = random_mixture(rng, 3, 2)
    x = np.array([[0.3], [-1.2]])
    result = mixture.regress(np.array([0]), x)
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
def test_regress_jacobian_equals_finite_differences(rng, K):
    mixture, inputs, x = random_mixture(rng, K, 5), np.array([1, 3]), rng.normal(size=(4, 2))
    exact = mixture.regress(inputs, x).jacobians
    for i in range(2):
        step = 1e-5 * np.eye(2)[i]
        slope = (mixture.regress(inputs, x + step).means - mixture.regress(inputs, x - step).means) / 2e-5
        np.testing.assert_allclose(exact[:, :, i], slope, rtol=1e-5, atol=1e-7)


def test_regress_one_component_equals_conditional(rng):
    mixture, inputs, x = random_mixture(rng, 1, 4), np.array([2, 0]), rng.normal(size=2)
    known = condition(Gaussian(mixture.means[0], mixture.covariances[0]), inputs, x)
    result = mixture.regress(inputs, x[None])
    np.testing.assert_allclose(result.means[0], known.mean)
    np.testing.assert_allclose(result.covariances[0], known.covariance)


@pytest.mark.parametrize("distance", [1e4, 1e9, 1e100])
def test_regress_far_input_uses_widest_component(rng, distance):
    """Responsibilities are computed in logarithms, so that no distance gives 0 / 0."""
    mixture, inputs = random_mixture(rng, 3, 3), np.array([0])
    x = np.array([[distance], [-distance]])
    widest = int(mixture.covariances[:, 0, 0].argmax())
    result = mixture.regress(inputs, x)
    for n in range(2):
        alone = condition(Gaussian(mixture.means[widest], mixture.covariances[widest]), inputs, x[n])
        np.testing.assert_allclose(result.means[n], alone.mean, rtol=1e-9)
        np.testing.assert_allclose(result.covariances[n], alone.covariance, rtol=1e-9)
    slope = mixture.covariances[widest, 1:, :1] / mixture.covariances[widest, 0, 0]
    np.testing.assert_allclose(result.jacobians, np.stack([slope, slope]), rtol=1e-9)


def test_regress_far_input_parallel_components_keep_slope(rng):
    """Components that differ only in the outputs keep their responsibilities everywhere."""
    single = random_mixture(rng, 1, 3)
    means = np.stack([single.means[0], single.means[0] + [0.0, 1.0, -2.0]])
    pair = GaussianMixture(np.array([0.3, 0.7]), means, np.repeat(single.covariances, 2, axis=0))
    slope = single.covariances[0, 1:, :1] / single.covariances[0, 0, 0]
    prediction = pair.regress(np.array([0]), np.array([[1e9]]))
    np.testing.assert_allclose(prediction.jacobians[0], slope, rtol=1e-6)
    within = condition(
        Gaussian(single.means[0], single.covariances[0]), np.array([0]), np.zeros(1)
    ).covariance
    between = 0.3 * 0.7 * np.outer([1.0, -2.0], [1.0, -2.0])
    np.testing.assert_allclose(prediction.covariances[0], within + between, rtol=1e-4, atol=1e-5)


def test_regress_zero_weight_component_has_no_influence(rng):
    """Also if it alone would explain the input."""
    mixture = random_mixture(rng, 2, 3)
    mixture.means[1] += 1e3
    with_zero_weight = GaussianMixture(np.array([1.0, 0.0]), mixture.means, mixture.covariances)
    alone = GaussianMixture(np.ones(1), mixture.means[:1], mixture.covariances[:1])
    x, inputs = mixture.means[1:, :1], np.array([0])
    prediction, expected = with_zero_weight.regress(inputs, x), alone.regress(inputs, x)
    np.testing.assert_allclose(prediction.means, expected.means)
    np.testing.assert_allclose(prediction.jacobians, expected.jacobians)


def test_log_input_densities_equal_marginals(rng):
    mixture, inputs, x = random_mixture(rng, 3, 5), np.array([3, 0]), rng.normal(size=(4, 2))
    found = conditional_gaussians(mixture.means, mixture.covariances, inputs).log_input_densities(x)
    for k in range(3):
        own = marginal(Gaussian(mixture.means[k], mixture.covariances[k]), inputs)
        np.testing.assert_allclose(found[:, k], log_density(own, x))


def test_regress_blocks_equal_single_rows(rng, monkeypatch):
    """Independent of the block size; no rows give no rows."""
    mixture, inputs, x = random_mixture(rng, 3, 4), np.array([1]), rng.normal(size=(7, 1))
    monkeypatch.setattr(regression, "MAX_ARRAY_SIZE", 2 * 3 * 3)  # two rows a block
    together = mixture.regress(inputs, x)
    for n in range(7):
        alone = mixture.regress(inputs, x[n : n + 1])
        np.testing.assert_allclose(together.means[n], alone.means[0])
        np.testing.assert_allclose(together.covariances[n], alone.covariances[0])
        np.testing.assert_allclose(together.jacobians[n], alone.jacobians[0])
    np.testing.assert_allclose(mixture.regress_means(inputs, x), together.means)
    assert mixture.regress(inputs, x[:0]).covariances.shape == (0, 3, 3)
    assert mixture.regress_means(inputs, x[:0]).shape == (0, 3)


def test_regress_rescaled_and_permuted_inputs_are_equivalent(rng):
    mixture, x = random_mixture(rng, 3, 4), rng.normal(size=(5, 2))
    units = 10.0 ** rng.uniform(-3, 3, size=4)
    scaled = GaussianMixture(
        mixture.weights, units * mixture.means, np.outer(units, units) * mixture.covariances
    )
    plain = mixture.regress(np.array([0, 2]), x)
    permuted = scaled.regress(np.array([2, 0]), (x * units[[0, 2]])[:, ::-1])
    out = units[[1, 3]]
    np.testing.assert_allclose(permuted.means, out * plain.means, rtol=1e-7)
    np.testing.assert_allclose(permuted.covariances, np.outer(out, out) * plain.covariances, rtol=1e-6)
    jacobians = out[:, None] * plain.jacobians[:, :, ::-1] / units[[2, 0]]
    np.testing.assert_allclose(permuted.jacobians, jacobians, rtol=1e-6, atol=1e-12)


def test_regress_with_responsibilities_one_hot_equals_conditional(rng):
    """Responsibilities may come from elsewhere, such as a Markov chain."""
    mixture, inputs, x = random_mixture(rng, 3, 4), np.array([1, 2]), rng.normal(size=(3, 2))
    conditionals = conditional_gaussians(mixture.means, mixture.covariances, inputs)
    result = regress_with_responsibilities(conditionals, x, np.eye(3))
    for k in range(3):
        alone = condition(Gaussian(mixture.means[k], mixture.covariances[k]), inputs, x[k])
        np.testing.assert_allclose(result.means[k], alone.mean)
        np.testing.assert_allclose(result.covariances[k], alone.covariance, rtol=1e-9)
        np.testing.assert_allclose(result.jacobians[k], conditionals.slopes[k])


def test_regress_invalid_inputs_raise(rng):
    mixture, inputs = random_mixture(rng, 2, 3), np.array([0, 2])
    with pytest.raises(InvalidInput, match="3 columns, expected 2"):
        mixture.regress(inputs, np.zeros((4, 3)))
    x = np.zeros((4, 2))
    x[2, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"x\[2, 1\] is nan.*leave out the row"):
        mixture.regress(inputs, x)
    with pytest.raises(InvalidInput, match=r"expected finite numbers of at most 1e\+150"):
        mixture.regress(inputs, np.array([[0.0, 0.0], [1e200, 0.0]]))
    with pytest.raises(InvalidInput, match="each column once"):
        mixture.regress(np.array([0, -3]), x)


def test_regress_inputs_without_outputs_raise(rng):
    with pytest.raises(InvalidInput, match="at least one input and one output"):
        random_mixture(rng, 2, 2).regress(np.array([0, 1]), np.zeros((1, 2)))
    with pytest.raises(InvalidInput, match="at least one input and one output"):
        random_mixture(rng, 2, 2).regress(np.array([], dtype=int), np.zeros((1, 0)))


def test_regress_singular_input_covariance_raises_with_index(rng):
    singular = GaussianMixture(np.ones(1), np.zeros((1, 3)), np.diag([0.0, 1.0, 1.0])[None])
    with pytest.raises(NotPositiveDefinite, match="component 0"):
        singular.regress(np.array([0]), np.zeros((1, 1)))
