"""Normal densities on R^n x S^3 x ...: a mean there, and a covariance in its tangent space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import Gaussian, log_density, precision_cholesky, product
from pilotfish.geometry import exp_map, exp_map_jacobian, log_map
from pilotfish.types import Array, Float

MAX_ITERATIONS, TOLERANCE = 100, 1e-10
STEP_SIZES = 0.5 ** np.arange(20)


@dataclass(frozen=True, slots=True, eq=False)
class RiemannianGaussian:
    """A density under which log_at(mean, x) is normal with this covariance; turns: where quaternions begin.

    As on R^n, its constant is that of the tangent space: right where the spread is small beside pi.
    Source: Pennec 2006, J. Mathematical Imaging and Vision 25; Zeestraten et al. 2017, IEEE RA-L 2(3).
    """

    mean: Float[Array, " D"]
    covariance: Float[Array, "E E"]
    orientation_starts: tuple[int, ...]


def riemannian_log_density(g: RiemannianGaussian, x: Float[Array, "N D"]) -> Float[Array, " N"]:
    """Log of the density at every row of x.

    Raises: NotPositiveDefinite, when the covariance is singular.
    """
    centred = Gaussian(np.zeros(len(g.covariance)), g.covariance)
    return log_density(centred, log_map(g.mean, x, g.orientation_starts))


def tangent_gaussian(g: RiemannianGaussian, point: Float[Array, " D"]) -> Gaussian:
    """The same density in the tangent space at another point: right in height and slope there.

    Covariances go by the exact differential of the exponential, from which parallel transport differs in
    second order of the distance.
    """
    return _tangent_gaussians(log_map(g.mean[None], point, g.orientation_starts), [g])[0]


def _tangent_gaussians(v: Float[Array, "P E"], gaussians: Sequence[RiemannianGaussian]) -> list[Gaussian]:
    """Several seen at one point, v being what leads to it from their means."""
    J = exp_map_jacobian(v, gaussians[0].orientation_starts)
    covariances = J @ np.stack([g.covariance for g in gaussians]) @ J.transpose(0, 2, 1)
    return [Gaussian(-back, C) for back, C in zip(v, covariances, strict=True)]  # J v = v: straight back


def riemannian_product(gaussians: Sequence[RiemannianGaussian]) -> RiemannianGaussian:
    """Where the product of the densities is largest, and its spread there: every opinion about one x, fused.

    Gauss-Newton: the opinions are brought to the tangent space at the current guess, where their product is
    that of R^n, and the guess moves to its mean; steps that lead down are halved. Ends at a maximum, to
    rounding: the nearest to that opinion's mean which all together like best; the covariance is that of the
    last tangent space.
    Raises: NotPositiveDefinite, when one covariance of several is singular.
    Source: Zeestraten et al. 2017, section III, with differentials where they transport covariances.
    """
    if len(gaussians) == 1:
        return gaussians[0]
    if not gaussians:
        raise InvalidInput("a product of no Gaussians was asked for; give at least one")
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
    return RiemannianGaussian(exp_map(x, step.mean, orientation_starts), step.covariance, orientation_starts)
