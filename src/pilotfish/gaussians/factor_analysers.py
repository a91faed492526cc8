"""Mixtures of factor analysers (MFA) and of probabilistic principal component analysers (MPPCA)."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.latent import (
    LatentCovariances,
    previous_latent,
    principal_components,
    require_factors,
    sweep,
)
from pilotfish.gaussians.structures import LARGEST_COUNT, Covariances
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number

FAINT = 1e-3  # share of the noise that a factor begins with at least: one of nothing would never grow


@dataclass(frozen=True, slots=True)
class MFA:
    """Every state has factors of its own, and every column noise of its own.

    sweeps       steps in every M-step. Each raises the likelihood, so few are enough inside
                 expectation-maximisation: the next M-step goes on from the same factors.
    least_noise  share of a column's variance below which its noise falls no further: without, it may go to
                 zero (a Heywood case) and the factors' precision beyond all bounds
    What is learned does not depend on the units of the columns, unlike with MPPCA and HDDC.
    Source: Ghahramani & Hinton 1996; Tanwani 2018, section 4.1.2.
    """

    factors: int
    sweeps: int = 5
    least_noise: float = 1e-8

    def __post_init__(self) -> None:
        _require_numbers("factors", self.factors, self.sweeps, self.least_noise)

    @property
    def label(self) -> str:
        return f"MFA({self.factors})"

    def estimate(
        self, mass: Float[Array, " K"], samples: Float[Array, "K D D"], previous: Covariances | None
    ) -> LatentCovariances:
        require_factors(self.label, self.factors, samples.shape[1])
        variances = np.diagonal(samples, axis1=1, axis2=2)
        _require_variance(variances)
        noise = partial(_own_noise, least=self.least_noise * variances)
        latent = previous_latent(previous, samples, self.factors)
        if latent is None:
            latent = _standardised_components(samples, self.factors, self.least_noise)
        for _ in range(self.sweeps):
            latent = sweep(samples, latent, noise)
        return latent

    def parameter_count(self, states: int, width: int) -> int:
        """D d loadings and D variances of noise for each state, as table 5.1 of the thesis counts."""
        return states * width * (self.factors + 1)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """d (d - 1) / 2 fewer than parameters for each state: factors may be turned among themselves."""
        turns = self.factors * (self.factors - 1) // 2
        return states * min(width * (self.factors + 1) - turns, width * (width + 1) // 2)


@dataclass(frozen=True, slots=True)
class MPPCA:
    """Every state has principal components of its own, and one variance of noise, the same in all columns.

    The M-step is the iteration of Tipping & Bishop 1999, without an eigendecomposition; HDDC has the same
    covariances in closed form. sweeps and least_noise are those of MFA.
    Columns should have comparable units, since they share their noise.
    Source: Tipping & Bishop 1999, Mixtures of probabilistic principal component analysers; Tanwani 2018,
    equations 4.14-4.16, corrected.
    """

    components: int
    sweeps: int = 5
    least_noise: float = 1e-8

    def __post_init__(self) -> None:
        _require_numbers("components", self.components, self.sweeps, self.least_noise)

    @property
    def label(self) -> str:
        return f"MPPCA({self.components})"

    def estimate(
        self, mass: Float[Array, " K"], samples: Float[Array, "K D D"], previous: Covariances | None
    ) -> LatentCovariances:
        require_factors(self.label, self.components, samples.shape[1])
        variances = np.diagonal(samples, axis1=1, axis2=2)
        _require_variance(variances)
        noise = partial(_shared_noise, least=self.least_noise * variances)
        latent = previous_latent(previous, samples, self.components)
        if latent is None:
            latent = _components(samples, self.components)
        for _ in range(self.sweeps):
            latent = sweep(samples, latent, noise)
        return latent

    def parameter_count(self, states: int, width: int) -> int:
        """D d loadings and one variance of noise for each state."""
        return states * (width * self.components + 1)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """d (d - 1) / 2 fewer than parameters for each state: components may be turned among themselves."""
        return states * (width * self.components + 1 - self.components * (self.components - 1) // 2)


def _own_noise(
    residual: Float[Array, "K D"], before: Float[Array, "K D"], least: Float[Array, "K D"]
) -> Float[Array, "K D"]:
    """The residual, but where it is less than least: then the least of both unless it was less before.

    The likelihood of a column's noise has one peak, at the residual, so none is lost by stopping on the way.
    """
    return np.asarray(np.maximum(residual, np.minimum(before, least)))


def _shared_noise(
    residual: Float[Array, "K D"], before: Float[Array, "K D"], least: Float[Array, "K D"]
) -> Float[Array, "K D"]:
    """The same with one noise for all columns of a state."""
    D = residual.shape[1]
    means = [np.tile(values.mean(axis=1, keepdims=True), (1, D)) for values in (residual, least)]
    return _own_noise(means[0], before, means[1])


def _components(S: Float[Array, "K D D"], factors: int) -> LatentCovariances:
    """Principal components, each of at least a faint length."""
    latent = principal_components(S, np.full(len(S), factors))
    if not factors:
        return latent
    lengths = np.linalg.norm(latent.loadings, axis=1)  # (K, L)
    least = np.sqrt(FAINT * latent.noise[:, :1])
    directions = np.linalg.eigh(S)[1][:, :, ::-1][:, :, :factors]
    return LatentCovariances(directions * np.maximum(lengths, least)[:, None, :], latent.noise)


def _standardised_components(S: Float[Array, "K D D"], factors: int, least: float) -> LatentCovariances:
    """Principal components of the columns scaled to unit variance, in the units of the columns."""
    scale = np.sqrt(np.diagonal(S, axis1=1, axis2=2))  # (K, D)
    start = _components(S / (scale[:, :, None] * scale[:, None, :]), factors)
    noise = np.maximum(1.0 - (start.loadings**2).sum(axis=2), least)
    return LatentCovariances(start.loadings * scale[:, :, None], noise * scale**2)


def _require_numbers(name: str, factors: int, sweeps: int, least_noise: float) -> None:
    require_count(factors, name, LARGEST_COUNT)
    require_count(sweeps, "sweeps", LARGEST_COUNT, 1)
    if not 0.0 < require_number(least_noise, "least_noise") < 1.0:
        raise InvalidInput(f"least_noise is {least_noise}, expected a share between 0 and 1, say 1e-8")


def _require_variance(variances: Float[Array, "K D"]) -> None:
    if (flat := np.argwhere(~(variances > 0.0))).size:
        k, column = flat[0]
        raise NotPositiveDefinite(
            f"the covariance of state {k} is not positive definite: column {column} (first is 0) has the "
            f"variance {variances[k, column]:.3g}; raise the regularisation, drop constant columns, "
            "or give more data"
        )
