"""Gaussians on R^n x S^3 x ...: a mean on the manifold, and a covariance in its tangent space.

The tangent coordinates are those of `geometry.log_map`: rotation vectors in body axes on orientations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import Gaussian, log_density, precision_cholesky, product
from pilotfish.geometry import exp_map, exp_map_jacobian, log_map
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MAX_ITERATIONS, TOLERANCE = 100, 1e-10
ROUNDING = 1e-9  # relative error of the cost
STEP_SIZES = 0.5 ** np.arange(20)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RiemannianGaussian:
    """Density under which log_map(mean, x) is Gaussian with this covariance.

    The normalising constant is that of the tangent space, which is accurate if standard deviations are small
    compared with pi.

    Attributes:
        mean: Point on the manifold.
        covariance: Covariance of tangent vectors at the mean.
        orientation_starts: First column of each quaternion in mean.

    Source:
        Pennec 2006, J. Mathematical Imaging and Vision 25; Zeestraten et al. 2017, IEEE RA-L 2(3).
    """

    mean: Float[Array, " D"]
    covariance: Float[Array, "E E"]
    orientation_starts: tuple[int, ...]

    def log_density(self, x: Float[Array, "N D"]) -> Float[Array, " N"]:
        """Return the log-density at every row of x.

        Args:
            x: Points on the manifold.

        Raises:
            NotPositiveDefinite: If the covariance is singular.
        """
        centred = Gaussian(np.zeros(len(self.covariance)), self.covariance)
        return log_density(centred, log_map(self.mean, x, self.orientation_starts))

    def tangent_gaussian(self, point: Float[Array, " D"]) -> Gaussian:
        """Return the density in the tangent space at another point, exact in value and slope at that point.

        The covariance is transformed by the differential of the exponential map; parallel transport would
        differ in second order of the distance.

        Args:
            point: Point on the manifold.
        """
        return _tangent_gaussians(log_map(self.mean[None], point, self.orientation_starts), [self])[0]

    @classmethod
    def product(cls, gaussians: Sequence["RiemannianGaussian"]) -> "RiemannianGaussian":
        """Return the mode of the product of densities, with the covariance in its tangent space.

        Gauss-Newton: the densities are transformed to the tangent space at the current point, where their
        product is that of R^n, and the point moves to its mean. Steps that increase the cost are halved. The
        iteration starts at the mean of lowest cost and ends at a local maximum of the product.

        Args:
            gaussians: Densities on the same manifold, at least one.

        Raises:
            InvalidInput: If there are none.
            NotPositiveDefinite: If one of several covariances is singular.

        Source:
            Zeestraten et al. 2017, section III, with differentials for parallel transport.
        """
        if len(gaussians) == 1:
            return gaussians[0]
        if not gaussians:
            raise InvalidInput("gaussians is empty, expected at least one Gaussian")
        orientation_starts = gaussians[0].orientation_starts

        W = precision_cholesky(np.stack([g.covariance for g in gaussians]), "the covariance of Gaussian")
        means = np.stack([g.mean for g in gaussians])

        def cost(v: Float[Array, "P E"]) -> float:
            return float(np.sum(np.einsum("pij,pj->pi", W, v) ** 2))

        x = min(means, key=lambda mean: cost(log_map(means, mean, orientation_starts)))
        v = log_map(means, x, orientation_starts)
        for _ in range(MAX_ITERATIONS):
            step = product(_tangent_gaussians(v, gaussians))
            candidates = (
                (
                    point := exp_map(x, size * step.mean, orientation_starts),
                    log_map(means, point, orientation_starts),
                )
                for size in STEP_SIZES
            )
            lower = next((candidate for candidate in candidates if cost(candidate[1]) < cost(v)), None)
            if lower is None or np.abs(step.mean).max() <= TOLERANCE:
                break
            x, v = lower
        end = exp_map(x, step.mean, orientation_starts)  # more exact than x where only rounding is left
        if cost(log_map(means, end, orientation_starts)) > (1.0 + ROUNDING) * cost(v):
            end = x  # next to a half turn from a mean, where the density jumps
        return cls(end, step.covariance, orientation_starts)


def _tangent_gaussians(v: Float[Array, "P E"], gaussians: Sequence[RiemannianGaussian]) -> list[Gaussian]:
    """Return the densities in the tangent space at one point; v leads to it from their means."""
    J = exp_map_jacobian(v, gaussians[0].orientation_starts)
    covariances = J @ np.stack([g.covariance for g in gaussians]) @ J.transpose(0, 2, 1)
    return [Gaussian(-step, C) for step, C in zip(v, covariances, strict=True)]  # since J v = v
