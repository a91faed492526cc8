"""Normal densities on R^n x S^3 x ...: a mean there, and a covariance in its tangent space."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import Gaussian, log_density, product
from pilotfish.geometry import differential, exp_at, log_at
from pilotfish.types import Array, Float

STEPS, ARRIVED = 100, 1e-11
HALVES = 0.5 ** np.arange(20)[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class RiemannianGaussian:
    """A density under which log_at(mean, x) is normal with this covariance; turns: where quaternions begin.

    As on R^n, its constant is that of the tangent space: right where the spread is small beside pi.
    Source: Pennec 2006, J. Mathematical Imaging and Vision 25; Zeestraten et al. 2017, IEEE RA-L 2(3).
    """

    mean: Float[Array, " D"]
    covariance: Float[Array, "E E"]
    turns: tuple[int, ...]


def riemannian_log_density(g: RiemannianGaussian, x: Float[Array, "N D"]) -> Float[Array, " N"]:
    """log of the density at every row of x.

    Raises: NotPositiveDefinite, when the covariance is singular.
    """
    centred = Gaussian(np.zeros(len(g.covariance)), g.covariance)
    return log_density(centred, log_at(g.mean, x, g.turns))


def seen_at(g: RiemannianGaussian, point: Float[Array, " D"]) -> Gaussian:
    """The same density in the tangent space at another point: right in height and slope there.

    Covariances go by the exact differential of the exponential, from which parallel transport differs in
    second order of the distance.
    """
    v = log_at(g.mean, point, g.turns)
    J = differential(v, g.turns)
    return Gaussian(-v, J @ g.covariance @ J.T)  # J v = v: the mean lies straight back


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
    turns = gaussians[0].turns

    def log_p(points: Float[Array, "N D"]) -> Float[Array, " N"]:
        return np.asarray(sum(riemannian_log_density(g, points) for g in gaussians))

    beginnings = np.stack([g.mean for g in gaussians])
    x = beginnings[log_p(beginnings).argmax()]
    for _ in range(STEPS):
        fused = product([seen_at(g, x) for g in gaussians])
        here, reached = log_p(x[None])[0], exp_at(x, HALVES * fused.mean, turns)
        up = np.flatnonzero(log_p(reached) > here)
        if not up.size or np.abs(fused.mean).max() <= ARRIVED:
            break
        x = reached[up[0]]
    return RiemannianGaussian(exp_at(x, fused.mean, turns), fused.covariance, turns)
