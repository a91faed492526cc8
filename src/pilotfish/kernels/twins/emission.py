"""Gaussian emissions seen from several frames."""

import numpy as np

from pilotfish.types import Array, Float

LOG_TWO_PI = float(np.log(2.0 * np.pi))


def log_emissions(
    x: Float[Array, "P N D"], means: Float[Array, "P K D"], whiteners: Float[Array, "P K D D"]
) -> Float[Array, "N K"]:
    """log b_k(x_n) = sum over frames p of log N(x[p, n] | means[p, k], Sigma[p, k]).

    whiteners[p, k] = W is the inverse of the lower Cholesky factor of Sigma[p, k], so that Sigma^-1 = W^T W;
    only its lower triangle is read.    Source: Tanwani 2018, eq. 3.22.
    """
    P, N, D = x.shape
    total = np.zeros((N, means.shape[1]))
    for p in range(P):
        for k, (mean, whitener) in enumerate(zip(means[p], np.tril(whiteners[p]), strict=True)):
            white = (x[p] - mean) @ whitener.T  # (N, D), of unit covariance
            half_log_det = np.log(np.diag(whitener)).sum()  # -log |Sigma| / 2
            total[:, k] += half_log_det - 0.5 * D * LOG_TWO_PI - 0.5 * np.square(white).sum(axis=1)
    return total
