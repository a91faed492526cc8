"""Gaussians on R^n x S^3 x ...: a mean on the manifold, and a covariance in its tangent space.

The tangent coordinates are those of `geometry.log_map`: rotation vectors in body axes on orientations.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import Gaussian, log_density, precision_cholesky
from pilotfish.geometry import exp_map_jacobian, log_map
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


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
        v = log_map(self.mean, point, self.orientation_starts)
        J = exp_map_jacobian(v, self.orientation_starts)
        return Gaussian(-v, J @ self.covariance @ J.T)  # since J v = v

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
        covariances = np.stack([g.covariance for g in gaussians])
        W = precision_cholesky(covariances, "the covariance of Gaussian")
        means, starts = np.stack([g.mean for g in gaussians]), gaussians[0].orientation_starts
        found = kernels.riemannian_product(
            kernels.Emissions(means[:, None], W[:, None], starts), covariances[:, None]
        )
        return cls(found.means[0], found.covariances[0], starts)
