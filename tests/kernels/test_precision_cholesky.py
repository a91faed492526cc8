"""Cholesky factors of precisions against their definition."""

import numpy as np
import pytest

from pilotfish.errors import NotPositiveDefinite


def covariances_of(rng, K, D):
    factors = rng.normal(size=(K, D, D)) / np.sqrt(D) + 0.3 * np.eye(D)
    return factors @ factors.transpose(0, 2, 1)


@pytest.mark.parametrize("D", [1, 2, 7, 8, 9, 14, 16, 17, 33, 94])
def test_precision_cholesky_whitens_covariances(kernels, rng, D):
    """It satisfies W Sigma W^T = I, W lower triangular with a positive diagonal: there is exactly one."""
    covariances = covariances_of(rng, 3, D)
    W = kernels.precision_cholesky(covariances)
    white = W @ covariances @ W.transpose(0, 2, 1)
    np.testing.assert_allclose(white, np.broadcast_to(np.eye(D), white.shape), atol=1e-9)
    np.testing.assert_array_equal(W, np.tril(W))
    assert (np.diagonal(W, axis1=1, axis2=2) > 0.0).all()


def test_precision_cholesky_entries_above_diagonal_are_ignored(kernels, rng):
    covariances = covariances_of(rng, 2, 9)
    stained = covariances + np.triu(np.full((9, 9), 1e9), 1)
    np.testing.assert_array_equal(
        kernels.precision_cholesky(stained), kernels.precision_cholesky(covariances)
    )


@pytest.mark.parametrize("D", [1, 5, 20])
@pytest.mark.parametrize("fault", ["flat", "negative", "nan", "inf"])
def test_precision_cholesky_invalid_covariance_raises_with_index(kernels, rng, D, fault):
    """Singular, indefinite, or not finite."""
    covariances = covariances_of(rng, 3, D)
    bad_value = {"flat": 0.0, "negative": -1.0, "nan": np.nan, "inf": np.inf}[fault]
    covariances[1, -1] = covariances[1, :, -1] = 0.0 if fault in {"flat", "negative"} else bad_value
    covariances[1, -1, -1] = bad_value
    with pytest.raises(NotPositiveDefinite, match="covariance 1 has no Cholesky factor"):
        kernels.precision_cholesky(covariances)
