"""Inverses of the Cholesky factors of covariances."""

import numpy as np

from pilotfish.kernels.errors import covariance_error
from pilotfish.types import Array, Float

MAX_DIRECT_SIZE = 16  # columns, up to which a general solver is as quick


def precision_cholesky(covariances: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    """Lower triangular W with W^T W = covariance^-1. Only lower triangles of covariances are read.

    Raises: NotPositiveDefinite, naming the first that has no Cholesky factor, or one that is not finite.
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
    """Inverses of lower triangular matrices: of large ones by halves, at a third of the cost of a solver."""
    D = L.shape[-1]
    if D <= MAX_DIRECT_SIZE:
        return np.tril(np.linalg.solve(L, np.broadcast_to(np.eye(D), L.shape)))
    half, W = D // 2, np.zeros_like(L)
    W[:, :half, :half] = _invert_lower_triangular(L[:, :half, :half])
    W[:, half:, half:] = _invert_lower_triangular(L[:, half:, half:])
    W[:, half:, :half] = -W[:, half:, half:] @ (L[:, half:, :half] @ W[:, :half, :half])
    return W
