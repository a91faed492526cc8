"""Log-densities of Gaussian emissions in several frames, with orientations on S^3."""

import numpy as np

from pilotfish.kernels.arguments import Emissions
from pilotfish.kernels.reference.manifold import deviations
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
