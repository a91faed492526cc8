"""Covariances with few latent factors: their form, closed-form estimates, and one EM step.

Model. x = mean + Lambda z + e with factors z ~ N(0, I) and noise e ~ N(0, Psi), Psi diagonal, so that
Sigma = Lambda Lambda^T + Psi. MFA leaves Psi free; MPPCA and HDDC use Psi = sigma^2 I.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures.structure import Covariances
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

MIN_VARIANCE_RATIO = 1e-15  # of the largest variance; below, a direction has no variance
MIN_CONDITIONAL_VARIANCE_RATIO = 1e-29  # computed from square roots of variances, so rounding is squared

# From the residual variance of every column and its previous noise to its noise; all (K, D).
NoiseUpdate = Callable[[Float[Array, "K D"], Float[Array, "K D"]], Float[Array, "K D"]]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LatentCovariances(Covariances):
    """Covariances Sigma_k = loadings[k] loadings[k]^T + diag(noise[k]).

    Attributes:
        loadings: Factor loadings. L is at least 1; a state with fewer than L factors has columns of zeros.
        noise: Noise variance of each column.
    """

    kind: ClassVar[str] = "latent"
    loadings: Float[Array, "K D L"]
    noise: Float[Array, "K D"]

    @property
    def dense(self) -> Float[Array, "K D D"]:
        eye = np.eye(self.noise.shape[1])
        return np.asarray(self.loadings @ self.loadings.transpose(0, 2, 1) + self.noise[:, None, :] * eye)

    @property
    def factors(self) -> Int[Array, " K"]:
        """Return the number of factors of each state."""
        return np.asarray(self.loadings.any(axis=1).sum(axis=1), dtype=np.int64)

    def validate_parameters(self, name: str) -> None:
        if (bad := np.argwhere(self.noise < 0.0)).size:
            raise InvalidInput(f"noise{bad[0].tolist()} is {self.noise[tuple(bad[0])]}, expected at least 0")

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        """Return the lower triangular matrices W with W^T W = covariance^-1, without inverting a matrix.

        Row j of W is the normalised innovation of a Kalman filter that observes the columns in order and
        whose state is the vector of factors. The filter keeps a square root of its covariance. Noise of
        1e-16 of a column's variance is therefore not lost, as it would be in the dense covariance.

        Args:
            name: What the covariances are; the error message begins with it.

        Raises:
            NotPositiveDefinite: If a column has no variance given the columns before it.

        Source:
            Potter 1963, as in Bierman 1977, Factorization methods for discrete sequential estimation.
        """
        K, D, L = self.loadings.shape
        W, gains = np.zeros((K, D, D)), np.zeros((K, L, D))  # gains[k] x: expected factors given x so far
        root = np.tile(np.eye(L), (K, 1, 1))  # root root^T: covariance of the factors given x so far
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
    positive = innovation_variance > MIN_CONDITIONAL_VARIANCE_RATIO * variance
    if (degenerate := np.flatnonzero(~(positive & (variance < np.inf)))).size:
        raise NotPositiveDefinite(
            f"{name} {degenerate[0]} is not positive definite: column {column} (first is 0) has the variance "
            f"{innovation_variance[degenerate[0]]:.3g} given the columns before it; raise the regularisation"
        )


def principal_components(S: Float[Array, "K D D"], factors: Int[Array, " K"]) -> LatentCovariances:
    """Return the most likely covariances with given numbers of factors and isotropic noise.

    The leading eigenpairs are kept, and every other eigenvalue is replaced by the mean of the others.

    Args:
        S: Sample covariances.
        factors: Number of factors of each state.

    Raises:
        NotPositiveDefinite: If a sample covariance has no variance outside its leading directions.

    Source:
        Tipping & Bishop 1999, equations 7-8; Tanwani 2018, equation 4.1.
    """
    D = S.shape[1]
    values, vectors = np.linalg.eigh(S)
    values, vectors = values[:, ::-1], vectors[:, :, ::-1]  # in decreasing order
    kept = np.arange(D) < factors[:, None]  # (K, D)
    noise = np.where(kept, 0.0, values).sum(axis=1) / (D - factors)
    _validate_noise(noise, values[:, 0], factors)
    lengths = np.sqrt(np.where(kept, np.maximum(values - noise[:, None], 0.0), 0.0))
    L = max(1, int(factors.max()))
    return LatentCovariances(vectors[:, :, :L] * lengths[:, None, :L], np.tile(noise[:, None], (1, D)))


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
    """Return covariances after one EM step, which does not lower their likelihood.

    With B = Lambda^T Sigma^-1 and V = I - B Lambda, the covariance of the factors given x:
    Lambda <- S B^T (V + B S B^T)^-1 and Psi <- diag(S - Lambda B S), which the noise update may average over
    columns. Only L x L systems are solved (Woodbury), for L factors.

    Args:
        S: Sample covariances.
        previous: Covariances before the step.
        noise: Update of the noise variances.

    Source:
        Ghahramani & Hinton 1996; Tanwani 2018, equations 4.9-4.13. With averaged noise it equals
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
    """Raise InvalidInput unless there are fewer factors than columns."""
    if factors >= width:
        raise InvalidInput(
            f"{name} has {factors} factors for {width} columns, expected fewer factors than columns; "
            "use pf.structures.Full() for unrestricted covariances"
        )


def warm_start(
    previous: object, sample_covariances: Float[Array, "K D D"], factors: int
) -> LatentCovariances | None:
    """Return previous if a fit with this number of factors can continue from it, else None."""
    shape = (*sample_covariances.shape[:2], max(1, factors))
    return previous if isinstance(previous, LatentCovariances) and previous.loadings.shape == shape else None
