"""Covariances of few latent factors: what they are, how they start, and one sweep of maximum likelihood."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.types import Array, Float, Int

MIN_VARIANCE_RATIO = 1e-15  # share of the largest variance below which a direction counts as having none
MIN_CONDITIONAL_VARIANCE_RATIO = (
    1e-29  # the same for a column given others, told by roots of variances and so to the square of rounding
)

# What is left of every column's variance, and its noise before, to its noise now; both (K, D).
NoiseUpdate = Callable[[Float[Array, "K D"], Float[Array, "K D"]], Float[Array, "K D"]]


@dataclass(frozen=True, slots=True, eq=False)
class LatentCovariances:
    """Sigma_k = loadings[k] loadings[k]^T + diag(noise[k]): a few factors, and noise of every column's own.

    A state of fewer factors than L has columns of zeros; L is at least 1.
    """

    loadings: Float[Array, "K D L"]
    noise: Float[Array, "K D"]

    @property
    def dense(self) -> Float[Array, "K D D"]:
        eye = np.eye(self.noise.shape[1])
        return np.asarray(self.loadings @ self.loadings.transpose(0, 2, 1) + self.noise[:, None, :] * eye)

    @property
    def factors(self) -> Int[Array, " K"]:
        """How many factors each state has."""
        return np.asarray(self.loadings.any(axis=1).sum(axis=1), dtype=np.int64)

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        """Lower triangular W with W^T W = covariance^-1; no matrix is inverted, only numbers are divided by.

        Row j is the normalised surprise of a Kalman filter that is shown column j after those before it, the
        factors being its state. The filter keeps a root of its covariance, so that noise of 1e-16 of a
        column's variance is not lost, as it would be in the covariance written out.
        Raises: NotPositiveDefinite, naming the first state and column that hold no surprise.
        Source: Potter 1963, as in Bierman 1977, Factorization methods for discrete sequential estimation.
        """
        K, D, L = self.loadings.shape
        W, gains = np.zeros((K, D, D)), np.zeros((K, L, D))  # gains[k] x: the factors expected of x so far
        root = np.tile(np.eye(L), (K, 1, 1))  # root root^T: what is not known of them yet
        for j in range(D):
            loading, noise = self.loadings[:, j], self.noise[:, j]
            projected_loading = np.einsum("kml,km->kl", root, loading)  # root^T loading
            innovation_variance = noise + (projected_loading**2).sum(axis=1)
            _validate_innovation(innovation_variance, noise + (loading**2).sum(axis=1), name, j)
            scale = 1.0 / np.sqrt(innovation_variance)
            W[:, j, :j] = -np.einsum("kl,kld->kd", loading, gains[:, :, :j]) * scale[:, None]
            W[:, j, j] = scale
            gain = np.einsum("klm,km->kl", root, projected_loading) * scale[:, None]
            gains[:, :, : j + 1] += gain[:, :, None] * W[:, None, j, : j + 1]
            root_gain = scale / (1.0 + np.sqrt(noise) * scale)
            root -= (gain * root_gain[:, None])[:, :, None] * projected_loading[:, None, :]
        return W


def _validate_innovation(
    innovation_variance: Float[Array, " K"], variance: Float[Array, " K"], name: str, column: int
) -> None:
    if (
        degenerate := np.flatnonzero(
            ~((innovation_variance > MIN_CONDITIONAL_VARIANCE_RATIO * variance) & (variance < np.inf))
        )
    ).size:
        raise NotPositiveDefinite(
            f"{name} {degenerate[0]} is not positive definite: column {column} (first is 0) has the variance "
            f"{innovation_variance[degenerate[0]]:.3g} given the columns before it; raise the regularisation"
        )


def principal_components(S: Float[Array, "K D D"], factors: Int[Array, " K"]) -> LatentCovariances:
    """The likeliest covariances of so many factors and isotropic noise, for sample covariances S.

    The leading eigenpairs are kept and every other eigenvalue is replaced by the mean of them all.
    Raises: NotPositiveDefinite, when a sample covariance has no variance outside its leading directions.
    Source: Tipping & Bishop 1999, equations 7-8; Tanwani 2018, equation 4.1.
    """
    D = S.shape[1]
    values, vectors = np.linalg.eigh(S)
    values, vectors = values[:, ::-1], vectors[:, :, ::-1]  # the largest first
    kept = np.arange(D) < factors[:, None]  # (K, D)
    noise = np.where(kept, 0.0, values).sum(axis=1) / (D - factors)
    _validate_noise(noise, values[:, 0], factors)
    spread = np.sqrt(np.where(kept, np.maximum(values - noise[:, None], 0.0), 0.0))
    L = max(1, int(factors.max()))
    return LatentCovariances(vectors[:, :, :L] * spread[:, None, :L], np.tile(noise[:, None], (1, D)))


def _validate_noise(
    noise: Float[Array, " K"], largest: Float[Array, " K"], factors: Int[Array, " K"]
) -> None:
    if (degenerate := np.flatnonzero(~(noise > MIN_VARIANCE_RATIO * np.abs(largest)))).size:
        k = degenerate[0]
        raise NotPositiveDefinite(
            f"the covariance of state {k} has no variance outside its {factors[k]} leading directions "
            f"({noise[k]:.3g} of {largest[k]:.3g}); raise the regularisation, ask for fewer factors, "
            "or give more data"
        )


def em_step(S: Float[Array, "K D D"], previous: LatentCovariances, noise: NoiseUpdate) -> LatentCovariances:
    """Covariances at least as likely as old for sample covariances S, one step of expectation-maximisation.

    With B = Lambda^T Sigma^-1 and V = I - B Lambda, the factors' covariance given x:
    Lambda <- S B^T (V + B S B^T)^-1,  Psi <- diag(S - Lambda B S), which noise may average over columns.
    Only d x d systems are solved (Woodbury), d being the number of factors.
    Source: Ghahramani & Hinton 1996; Tanwani 2018, equations 4.9-4.13. With averaged noise it equals
    (4.14)-(4.15), corrected: M = Lambda^T Lambda + sigma^2 I where the thesis prints Sigma.
    """
    weighted = (previous.loadings / previous.noise[:, :, None]).transpose(
        0, 2, 1
    )  # Lambda^T Psi^-1, (K, L, D)
    V = np.linalg.inv(np.eye(weighted.shape[1]) + weighted @ previous.loadings)
    BS = V @ (weighted @ S)
    outer = V + BS @ weighted.transpose(0, 2, 1) @ V  # expected outer product of the factors
    loadings = np.linalg.solve(outer, BS).transpose(0, 2, 1)
    residual = np.diagonal(S, axis1=1, axis2=2) - np.einsum("kdl,kld->kd", loadings, BS)
    return LatentCovariances(loadings, noise(residual, previous.noise))


def validate_factor_count(name: str, factors: int, width: int) -> None:
    """Raises: InvalidInput, when covariances of this width cannot have so many factors."""
    if factors >= width:
        raise InvalidInput(
            f"{name} has {factors} factors for {width} columns, expected fewer factors than columns; "
            "pf.structures.Full() leaves covariances free"
        )


def warm_start(
    previous: object, sample_covariances: Float[Array, "K D D"], factors: int
) -> LatentCovariances | None:
    """previous, when a fit of so many factors can go on from it."""
    shape = (*sample_covariances.shape[:2], max(1, factors))
    return previous if isinstance(previous, LatentCovariances) and previous.loadings.shape == shape else None
