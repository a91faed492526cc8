"""Opinions about one thing, pooled: the normalised product of Gaussians, each raised to a power."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Bool, Float

MIN_POOL_WEIGHT = 1e-9  # power of a frame that is heard; at zero alone the pool would be flat


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutSegment:
    """What P frames say of a visit that was held out, in deviations as each frame sees them.

    offsets[p] leads from the visit's mean to the frame's, W = whiteners[p] has W^T W = covariance^-1, and
    scatters[p] is the covariance of the visit's own points.
    """

    offsets: Float[Array, "P E"]
    precision_cholesky: Float[Array, "P E E"]
    scatter_matrices: Float[Array, "P E E"]


@dataclass(frozen=True, slots=True, eq=False)
class Opinions:
    """The same in the world, for M held-out visits, each about its own mean.

    precisions[m, p] is what frame p knows, shifts[m, p] is it times the frame's mean, and surprises[m, p] the
    mean of u^T precision u over the visit's points u.
    """

    precisions: Float[Array, "M P E E"]
    information_vectors: Float[Array, "M P E"]
    mean_squares: Float[Array, "M P"]

    @property
    def frames(self) -> int:
        return int(self.mean_squares.shape[1])


def pool_opinions(
    from_world: Sequence[Float[Array, "P E E"]], segments: Sequence[HeldOutSegment]
) -> Opinions:
    """Each frame's opinion carried to the world: u there is from_world[m][p] u in frame p."""
    precisions, information_vectors, mean_squares = [], [], []
    for B, opinions in zip(from_world, segments, strict=True):
        world_precision_cholesky = (
            opinions.precision_cholesky @ B
        )  # (P, E, E), from the world to unit covariance
        precisions.append(world_precision_cholesky.transpose(0, 2, 1) @ world_precision_cholesky)
        means = np.einsum("pij,pj->pi", opinions.precision_cholesky, opinions.offsets)
        information_vectors.append(np.einsum("pij,pi->pj", world_precision_cholesky, means))
        whitened_scatter = (
            opinions.precision_cholesky
            @ opinions.scatter_matrices
            @ opinions.precision_cholesky.transpose(0, 2, 1)
        )
        mean_squares.append(np.trace(whitened_scatter, axis1=1, axis2=2))
    return Opinions(np.stack(precisions), np.stack(information_vectors), np.stack(mean_squares))


def held_out_log_probs(opinions: Opinions, pool_weights: Float[Array, " P"]) -> Float[Array, " M"]:
    """Mean log-probability of each held-out visit's points under the pool, up to one constant for all powers.

    With L = sum of v_p L_p and h = sum of v_p h_p it is (log |L| - v . s - h^T L^-1 h) / 2.
    """
    L = np.einsum("p,mpij->mij", pool_weights, opinions.precisions)
    h = np.einsum("p,mpi->mi", pool_weights, opinions.information_vectors)
    means = np.linalg.solve(L, h[..., None])[..., 0]
    log_determinants = np.linalg.slogdet(L)[1]
    return np.asarray(
        0.5 * (log_determinants - opinions.mean_squares @ pool_weights - np.sum(h * means, axis=1))
    )


def log_prob_gradient(opinions: Opinions, pool_weights: Float[Array, " P"]) -> Float[Array, " P"]:
    """The derivative of the mean of log_scores with respect to each power."""
    L = np.einsum("p,mpij->mij", pool_weights, opinions.precisions)
    h = np.einsum("p,mpi->mi", pool_weights, opinions.information_vectors)
    means = np.linalg.solve(L, h[..., None])[..., 0]
    expected = np.einsum("mij,mpji->mp", np.linalg.inv(L), opinions.precisions)  # tr(L^-1 L_p)
    quadratic = np.einsum("mi,mpij,mj->mp", means, opinions.precisions, means)
    linear = np.einsum("mpi,mi->mp", opinions.information_vectors, means)
    return np.asarray((0.5 * (expected - opinions.mean_squares + quadratic) - linear).mean(axis=0))


def fit_pool_weights(opinions: Opinions, weighted: Bool[Array, " P"]) -> Float[Array, " P"]:
    """The powers of the frames heard, zero for the others, that make the held-out visits most probable.

    The mean of log_scores is concave in the powers, so there is one best value; where several powers give it
    (frames that say the same) the one nearest to equal shares, from which the search begins.
    Source: Heskes 1998, Selecting weighting factors in logarithmic opinion pools.
    """
    from scipy.optimize import minimize  # here, because scipy doubles the time of importing pilotfish

    subset = Opinions(
        opinions.precisions[:, weighted],
        opinions.information_vectors[:, weighted],
        opinions.mean_squares[:, weighted],
    )
    start = np.full(subset.frames, 1.0 / subset.frames)

    def loss(pool_weights: Float[Array, " P"]) -> tuple[float, Float[Array, " P"]]:
        return -float(held_out_log_probs(subset, pool_weights).mean()), -log_prob_gradient(
            subset, pool_weights
        )

    result = minimize(
        loss, start, jac=True, method="L-BFGS-B", bounds=[(MIN_POOL_WEIGHT, None)] * subset.frames
    )
    pool_weights = np.zeros(opinions.frames)
    pool_weights[weighted] = result.x
    return pool_weights
