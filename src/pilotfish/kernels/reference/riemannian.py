"""Product of Gaussians on R^n x S^3 x ..., by Gauss-Newton."""

import numpy as np

from pilotfish.kernels.arguments import Emissions
from pilotfish.kernels.reference.manifold import deviations, displaced, displacement_jacobian
from pilotfish.kernels.results import RiemannianProduct
from pilotfish.types import Array, Float

MAX_ITERATIONS, TOLERANCE = 100, 1e-10
ROUNDING = 1e-9  # relative error of the cost
HALVINGS = 20


def riemannian_product(emissions: Emissions, covariances: Float[Array, "P K E E"]) -> RiemannianProduct:
    """Return the mode of the product over frames of each state, with the covariance in its tangent space.

    Gauss-Newton: the densities are transformed to the tangent space at the current point, where their product
    is that of R^n, and the point moves to its mean. Steps that do not decrease the cost are halved. The
    iteration starts at the mean of lowest cost and ends at a local maximum of the product.

    Args:
        emissions: Gaussians in every frame.
        covariances: Their covariances.

    Source:
        Zeestraten et al. 2017, IEEE RA-L 2(3), section III, with differentials for parallel transport.
    """
    found = [
        _product(means, C, np.tril(W), emissions.orientation_starts)
        for means, C, W in zip(
            emissions.means.swapaxes(0, 1),
            covariances.swapaxes(0, 1),
            emissions.precision_cholesky.swapaxes(0, 1),
            strict=True,
        )
    ]
    return RiemannianProduct(np.stack([mean for mean, _ in found]), np.stack([C for _, C in found]))


def _product(
    means: Float[Array, "P D"],
    covariances: Float[Array, "P E E"],
    W: Float[Array, "P E E"],
    orientation_starts: tuple[int, ...],
) -> tuple[Float[Array, " D"], Float[Array, "E E"]]:
    """Return mean and covariance of the product of P Gaussians."""

    def leading_to(x: Float[Array, " D"]) -> Float[Array, "P E"]:
        """Return the tangent vectors from the means to x: the negatives of those from x."""
        return -deviations(means, x, orientation_starts)

    def cost(v: Float[Array, "P E"]) -> float:
        return float(np.sum(np.einsum("pij,pj->pi", W, v) ** 2))

    x = min(means, key=lambda mean: cost(leading_to(mean)))
    v = leading_to(x)
    for _ in range(MAX_ITERATIONS):
        step, covariance = _tangent_product(v, covariances, orientation_starts)
        for n in range(HALVINGS):
            point = displaced(x, 0.5**n * step, orientation_starts)
            if cost(leading_to(point)) < cost(v):
                break
        else:
            break
        if np.abs(step).max() <= TOLERANCE:
            break
        x, v = point, leading_to(point)
    end = displaced(x, step, orientation_starts)  # more exact than x where only rounding is left
    if cost(leading_to(end)) > (1.0 + ROUNDING) * cost(v):
        end = x  # next to a half turn from a mean, where the density jumps
    return end, covariance


def _tangent_product(
    v: Float[Array, "P E"], covariances: Float[Array, "P E E"], orientation_starts: tuple[int, ...]
) -> tuple[Float[Array, " E"], Float[Array, "E E"]]:
    """Return mean and covariance of the product in the tangent space at one point; v leads to it.

    Pairs are multiplied as Sp (Sp + Sq)^-1 Sq, which has no subtraction.
    """
    mean, covariance = np.zeros(v.shape[1]), np.zeros(covariances.shape[1:])
    for p, (deviation, C) in enumerate(zip(v, covariances, strict=True)):
        J = displacement_jacobian(deviation, orientation_starts)
        other = J @ C @ J.T  # around -deviation, since J deviation = deviation
        if p == 0:
            mean, covariance = -deviation, other
            continue
        gain = np.linalg.solve(covariance + other, covariance).T
        mean = mean - gain @ (deviation + mean)
        product = gain @ other
        covariance = 0.5 * (product + product.T)
    return mean, covariance
