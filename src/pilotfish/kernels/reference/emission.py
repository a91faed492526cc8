"""Gaussian emissions seen from several frames."""

import numpy as np

from pilotfish.kernels.arguments import Emissions
from pilotfish.types import Array, Float

LOG_TWO_PI = float(np.log(2.0 * np.pi))


def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    """Log b_k(x_n) = sum over frames p of log N(deviation of x[p, n] from means[p, k] | 0, Sigma[p, k]).

    Source: Tanwani 2018, eq. 3.22.
    """
    P, N, _ = x.shape
    means, E = emissions.means, emissions.precision_cholesky.shape[-1]
    total = np.zeros((N, means.shape[1]))
    for p in range(P):
        for k, (mean, precision_factor) in enumerate(
            zip(means[p], np.tril(emissions.precision_cholesky[p]), strict=True)
        ):
            whitened = (
                deviations(x[p], mean, emissions.orientation_starts) @ precision_factor.T
            )  # (N, E), of unit covariance
            half_log_det = np.log(np.diag(precision_factor)).sum()  # -log |Sigma| / 2
            total[:, k] += half_log_det - 0.5 * E * LOG_TWO_PI - 0.5 * np.square(whitened).sum(axis=1)
    return total


def deviations(
    x: Float[Array, "N D"], mean: Float[Array, " D"], orientation_starts: tuple[int, ...] = ()
) -> Float[Array, "N E"]:
    """X - mean; the rotation vector [rad] instead for unit quaternions, which begin at the columns of turns.

    It turns mean to x in the axes of the turned body, 2 log(mean* x), by at most pi: q and -q deviate alike.
    """
    parts, end = [], 0
    for start in sorted(orientation_starts):
        parts += [
            x[:, end:start] - mean[end:start],
            rotation_vectors(mean[start : start + 4], x[:, start : start + 4]),
        ]
        end = start + 4
    return np.concatenate([*parts, x[:, end:] - mean[end:]], axis=1)


def rotation_vectors(mean: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """2 log(mean* q), of q or -q, whichever is nearer."""
    w, x, y, z = mean
    conjugate_matrix = np.array(
        [[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]
    )  # of multiplying by mean*
    relative = q @ conjugate_matrix.T
    relative = np.where(relative[:, :1] < 0.0, -relative, relative)
    sine = np.linalg.norm(relative[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, relative[:, :1])
    return np.asarray(relative[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0))
