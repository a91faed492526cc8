"""Gaussian emissions seen from several frames."""

import numpy as np

from pilotfish.kernels.arguments import Emissions
from pilotfish.types import Array, Float

LOG_TWO_PI = float(np.log(2.0 * np.pi))


def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    """log b_k(x_n) = sum over frames p of log N(deviation of x[p, n] from means[p, k] | 0, Sigma[p, k]).

    Source: Tanwani 2018, eq. 3.22.
    """
    P, N, _ = x.shape
    means, E = emissions.means, emissions.whiteners.shape[-1]
    total = np.zeros((N, means.shape[1]))
    for p in range(P):
        for k, (mean, whitener) in enumerate(zip(means[p], np.tril(emissions.whiteners[p]), strict=True)):
            white = deviations(x[p], mean, emissions.turns) @ whitener.T  # (N, E), of unit covariance
            half_log_det = np.log(np.diag(whitener)).sum()  # -log |Sigma| / 2
            total[:, k] += half_log_det - 0.5 * E * LOG_TWO_PI - 0.5 * np.square(white).sum(axis=1)
    return total


def deviations(
    x: Float[Array, "N D"], mean: Float[Array, " D"], turns: tuple[int, ...] = ()
) -> Float[Array, "N E"]:
    """x - mean; the rotation vector [rad] instead for unit quaternions, which begin at the columns of turns.

    It turns mean to x in the axes of the turned body, 2 log(mean* x), by at most pi: q and -q deviate alike.
    """
    parts, done = [], 0
    for start in sorted(turns):
        parts += [
            x[:, done:start] - mean[done:start],
            rotation_vectors(mean[start : start + 4], x[:, start : start + 4]),
        ]
        done = start + 4
    return np.concatenate([*parts, x[:, done:] - mean[done:]], axis=1)


def rotation_vectors(mean: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """2 log(mean* q), of q or -q, whichever is nearer."""
    w, x, y, z = mean
    back = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])  # of multiplying by mean*
    between = q @ back.T
    between = np.where(between[:, :1] < 0.0, -between, between)
    sine = np.linalg.norm(between[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, between[:, :1])
    return np.asarray(between[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0))
