"""Log-densities of Gaussian emissions in several frames, with orientations on S^3."""

import numpy as np

from pilotfish.kernels.arguments import Emissions
from pilotfish.types import Array, Float

LOG_TWO_PI = float(np.log(2.0 * np.pi))


def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    """Return log b_k(x_n), the sum over frames p of log N(x[p, n] - means[p, k] | 0, Sigma[p, k]).

    On unit quaternions the difference is a rotation vector, see `deviations`.

    Args:
        x: Datapoints in every frame.
        emissions: Gaussians in every frame.

    Source:
        Tanwani 2018, eq. 3.22.
    """
    P, N, _ = x.shape
    means, E = emissions.means, emissions.precision_cholesky.shape[-1]
    total = np.zeros((N, means.shape[1]))
    for p in range(P):
        for k, (mean, precision_factor) in enumerate(
            zip(means[p], np.tril(emissions.precision_cholesky[p]), strict=True)
        ):
            errors = deviations(x[p], mean, emissions.orientation_starts)
            whitened = errors @ precision_factor.T  # (N, E), of unit covariance
            half_log_det = np.log(np.diag(precision_factor)).sum()  # -log |Sigma| / 2
            total[:, k] += half_log_det - 0.5 * E * LOG_TWO_PI - 0.5 * np.square(whitened).sum(axis=1)
    return total


def deviations(
    x: Float[Array, "N D"], mean: Float[Array, " D"], orientation_starts: tuple[int, ...] = ()
) -> Float[Array, "N E"]:
    """Return x - mean, and on unit quaternions the rotation vector 2 log(mean* x) [rad] in body axes."""
    parts, end = [], 0
    for start in sorted(orientation_starts):
        parts += [
            x[:, end:start] - mean[end:start],
            rotation_vectors(mean[start : start + 4], x[:, start : start + 4]),
        ]
        end = start + 4
    return np.concatenate([*parts, x[:, end:] - mean[end:]], axis=1)


def rotation_vectors(mean: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """Return 2 log(mean* q), for the nearer of q and -q, so that it is at most pi long."""
    w, x, y, z = mean
    # multiplication by mean* from the left
    conjugate_matrix = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
    relative = q @ conjugate_matrix.T
    relative = np.where(relative[:, :1] < 0.0, -relative, relative)
    sine = np.linalg.norm(relative[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, relative[:, :1])
    return np.asarray(relative[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0))
