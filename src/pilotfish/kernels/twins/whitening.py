"""Inverses of the Cholesky factors of covariances."""

import numpy as np

from pilotfish.kernels.refusals import no_factor
from pilotfish.types import Array, Float

SMALL = 16  # columns, up to which a general solver is as quick


def whiteners(covariances: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    """Lower triangular W with W^T W = covariance^-1. Only lower triangles of covariances are read.

    Raises: NotPositiveDefinite, naming the first that has no Cholesky factor, or one that is not finite.
    """
    factors = np.stack([_factor(covariance, k) for k, covariance in enumerate(covariances)])
    return _inverses_of_lower(factors)


def _factor(covariance: Float[Array, "D D"], k: int) -> Float[Array, "D D"]:
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise no_factor(k) from None
    if not np.isfinite(factor).all():
        raise no_factor(k)
    return factor


def _inverses_of_lower(L: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    """Inverses of lower triangular matrices: of large ones by halves, at a third of the cost of a solver."""
    D = L.shape[-1]
    if D <= SMALL:
        return np.tril(np.linalg.solve(L, np.broadcast_to(np.eye(D), L.shape)))
    half, W = D // 2, np.zeros_like(L)
    W[:, :half, :half] = _inverses_of_lower(L[:, :half, :half])
    W[:, half:, half:] = _inverses_of_lower(L[:, half:, half:])
    W[:, half:, :half] = -W[:, half:, half:] @ (L[:, half:, :half] @ W[:, :half, :half])
    return W
