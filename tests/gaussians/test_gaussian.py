"""Statements of single Gaussians."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import (
    Gaussian,
    affine_transform,
    condition,
    log_density,
    marginal,
    precision_cholesky,
    product,
    sample,
)
from pilotfish.gaussians.gaussian import confidence_radius


def random_gaussian(rng, D, scale=1.0):
    A = rng.normal(size=(D, D)) * scale
    return Gaussian(rng.normal(size=D), A @ A.T + 0.1 * scale**2 * np.eye(D))


@pytest.mark.parametrize("D", [1, 2, 14])
def test_log_density_equals_scipy(rng, D):
    g, x = random_gaussian(rng, D), rng.normal(size=(9, D))
    np.testing.assert_allclose(
        log_density(g, x), multivariate_normal(g.mean, g.covariance).logpdf(x).reshape(9)
    )


def test_log_density_narrow_gaussian_in_14_dimensions_has_no_floor():
    """Log N(mean) = D (-log sigma - log(2 pi) / 2), although the determinant is far below machine epsilon."""
    g = Gaussian(np.zeros(14), 1e-4 * np.eye(14))
    expected = 14 * (-np.log(1e-2) - 0.5 * np.log(2 * np.pi))
    np.testing.assert_allclose(log_density(g, np.zeros((1, 14))), expected, rtol=1e-12)


@pytest.mark.parametrize("P", [1, 2, 4])
@pytest.mark.parametrize("D", [1, 3, 14])
def test_product_equals_pointwise_product_up_to_constant(rng, D, P):
    """The sum of log p_j(x) minus log r(x) is the same at every x."""
    parts, x = [random_gaussian(rng, D) for _ in range(P)], rng.normal(size=(6, D))
    constants = sum(log_density(p, x) for p in parts) - log_density(product(parts), x)
    np.testing.assert_allclose(constants, constants[0], atol=1e-6 * max(1, abs(constants[0])))


def test_product_any_order_is_equal(rng):
    parts = [random_gaussian(rng, 4) for _ in range(3)]
    forward, backward = product(parts), product(parts[::-1])
    np.testing.assert_allclose(forward.mean, backward.mean)
    np.testing.assert_allclose(forward.covariance, backward.covariance)


def test_product_scales_of_twelve_orders_keeps_precision():
    wide, narrow = Gaussian(np.zeros(1), np.array([[1e6]])), Gaussian(np.ones(1), np.array([[1e-6]]))
    for fused in (product([wide, narrow]), product([narrow, wide])):
        np.testing.assert_allclose(fused.covariance, 1.0 / (1e-6 + 1e6), rtol=1e-12)


def test_product_singular_factor_keeps_its_mean_there(rng):
    p, q = Gaussian(np.array([1.0, 2.0]), np.diag([0.0, 1.0])), random_gaussian(rng, 2)
    np.testing.assert_allclose(product([p, q]).mean[0], 1.0)
    np.testing.assert_allclose(product([q, p]).mean[0], 1.0)


def test_product_two_singular_factors_raises():
    p = Gaussian(np.zeros(2), np.diag([0.0, 1.0]))
    with pytest.raises(NotPositiveDefinite, match="eigenvalues are from 0"):
        product([p, Gaussian(np.ones(2), np.diag([0.0, 1.0]))])
    with pytest.raises(InvalidInput, match="at least one"):
        product([])


def test_affine_transform_changes_density_by_determinant(rng):
    """The density satisfies p(x) = |det A| q(A x + b), so a precision is transformed by A^-T."""
    g, A, b, x = random_gaussian(rng, 3), rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=(5, 3))
    moved = log_density(affine_transform(g, A, b), x @ A.T + b) + np.linalg.slogdet(A)[1]
    np.testing.assert_allclose(moved, log_density(g, x))


def test_marginal_times_conditional_equals_joint(rng):
    g, x = random_gaussian(rng, 5), rng.normal(size=5)
    columns, rest = np.array([3, 0]), np.array([1, 2, 4])
    known = log_density(marginal(g, columns), x[None, columns])
    unknown = log_density(condition(g, columns, x[columns]), x[None, rest])
    np.testing.assert_allclose(known + unknown, log_density(g, x[None]))


def test_sample_has_mean_and_covariance(rng):
    g, N = random_gaussian(rng, 3), 40_000
    x = sample(g, N, rng)
    deviations = np.sqrt(np.diag(g.covariance))
    np.testing.assert_allclose(x.mean(axis=0), g.mean, atol=5 * deviations.max() / np.sqrt(N))
    np.testing.assert_allclose(np.cov(x.T), g.covariance, atol=7 * deviations.max() ** 2 * np.sqrt(2 / N))


def test_sample_singular_gaussian_stays_in_range(rng):
    x = sample(Gaussian(np.zeros(2), np.array([[1.0, 1.0], [1.0, 1.0]])), 50, rng)
    np.testing.assert_allclose(x[:, 0], x[:, 1], atol=1e-7)


@pytest.mark.parametrize("D", [1, 2, 3, 5])
def test_in_confidence_region_ninety_percent_contains_ninety_percent_of_samples(rng, D):
    g = random_gaussian(rng, D)
    share = g.in_confidence_region(sample(g, 20_000, rng), 0.9).mean()
    assert abs(share - 0.9) < 5 * np.sqrt(0.9 * 0.1 / 20_000)


def test_confidence_radius_one_dimension_one_sigma_is_683_per_mille():
    np.testing.assert_allclose(confidence_radius(1, 0.6826894921370859), 1.0)
    with pytest.raises(InvalidInput, match="between 0 and 1"):
        confidence_radius(2, 95.0)


def test_ellipse_has_its_mahalanobis_radius(rng):
    g = random_gaussian(rng, 2)
    W = precision_cholesky(g.covariance[None])[0]
    np.testing.assert_allclose(np.linalg.norm((g.ellipse(1.7) - g.mean) @ W.T, axis=1), 1.7)
    with pytest.raises(InvalidInput, match="take a marginal"):
        random_gaussian(rng, 3).ellipse(1.0)


def test_cholesky_singular_covariance_raises_with_index_and_fix():
    covariances = np.stack([np.eye(2), np.array([[1.0, 1.0], [1.0, 1.0]])])
    with pytest.raises(NotPositiveDefinite, match=r"state 1 is not positive definite.*regularisation"):
        precision_cholesky(covariances, "state")
    with pytest.raises(NotPositiveDefinite, match="not finite"):
        precision_cholesky(np.full((1, 2, 2), np.nan))


@pytest.mark.parametrize("D", [1, 16, 17, 33, 94])
def test_precision_cholesky_any_width_is_lower_triangular_and_whitens(rng, D: int):
    """W C W^T = I, also for block inversion with blocks of unequal size."""
    roots = rng.normal(size=(3, D, D))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(D)
    W = precision_cholesky(covariances)
    np.testing.assert_array_equal(W, np.tril(W))
    np.testing.assert_allclose(
        W @ covariances @ W.transpose(0, 2, 1), np.tile(np.eye(D), (3, 1, 1)), atol=1e-10
    )


def test_marginal_negative_columns_count_from_end_and_missing_ones_raise(rng):
    g = random_gaussian(rng, 3)
    last, same = (condition(g, np.array([n]), np.array([0.3])) for n in (-1, 2))
    np.testing.assert_array_equal(last.mean, same.mean)
    np.testing.assert_array_equal(last.covariance, same.covariance)
    for columns in ([3], [-4], [0, 0], [1, -2]):
        with pytest.raises(InvalidInput, match="columns"):
            condition(g, np.array(columns), np.zeros(len(columns)))
