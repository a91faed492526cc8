"""Mixtures of factor analysers (MFA) and of probabilistic principal component analysers (MPPCA)."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures.dense import MAX_COUNT, Covariances
from pilotfish.gaussians.structures.latent import (
    LatentCovariances,
    em_step,
    principal_components,
    validate_factor_count,
    warm_start,
)
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number

MIN_LOADING_RATIO = (
    1e-3  # share of the noise that a factor begins with at least: one of nothing would never grow
)


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
    min_noise: float = 1e-8

    def __post_init__(self) -> None:
        _validate_settings("factors", self.factors, self.sweeps, self.min_noise)

    @property
    def label(self) -> str:
        return f"MFA({self.factors})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> LatentCovariances:
        validate_factor_count(self.label, self.factors, sample_covariances.shape[1])
        variances = np.diagonal(sample_covariances, axis1=1, axis2=2)
        _validate_variance(variances)
        noise = partial(_floor_noise, floor=self.min_noise * variances)
        latent = warm_start(previous, sample_covariances, self.factors)
        if latent is None:
            latent = _initial_standardised_components(sample_covariances, self.factors, self.min_noise)
        for _ in range(self.sweeps):
            latent = em_step(sample_covariances, latent, noise)
        return latent

    def parameter_count(self, states: int, width: int) -> int:
        """D d loadings and D variances of noise for each state, as table 5.1 of the thesis counts."""
        return states * width * (self.factors + 1)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """D (d - 1) / 2 fewer than parameters for each state: factors may be turned among themselves."""
        rotations = self.factors * (self.factors - 1) // 2
        return states * min(width * (self.factors + 1) - rotations, width * (width + 1) // 2)


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
    min_noise: float = 1e-8

    def __post_init__(self) -> None:
        _validate_settings("components", self.components, self.sweeps, self.min_noise)

    @property
    def label(self) -> str:
        return f"MPPCA({self.components})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> LatentCovariances:
        validate_factor_count(self.label, self.components, sample_covariances.shape[1])
        variances = np.diagonal(sample_covariances, axis1=1, axis2=2)
        _validate_variance(variances)
        noise = partial(_floor_shared_noise, floor=self.min_noise * variances)
        latent = warm_start(previous, sample_covariances, self.components)
        if latent is None:
            latent = _initial_components(sample_covariances, self.components)
        for _ in range(self.sweeps):
            latent = em_step(sample_covariances, latent, noise)
        return latent

    def parameter_count(self, states: int, width: int) -> int:
        """D d loadings and one variance of noise for each state."""
        return states * (width * self.components + 1)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """D (d - 1) / 2 fewer than parameters for each state: components may be turned among themselves."""
        return states * (width * self.components + 1 - self.components * (self.components - 1) // 2)


def _floor_noise(
    residual: Float[Array, "K D"], previous_noise: Float[Array, "K D"], floor: Float[Array, "K D"]
) -> Float[Array, "K D"]:
    """The residual, but where it is less than least: then the least of both unless it was less before.

    The likelihood of a column's noise has one peak, at the residual, so none is lost by stopping on the way.
    """
    return np.asarray(np.maximum(residual, np.minimum(previous_noise, floor)))


def _floor_shared_noise(
    residual: Float[Array, "K D"], previous_noise: Float[Array, "K D"], floor: Float[Array, "K D"]
) -> Float[Array, "K D"]:
    """The same with one noise for all columns of a state."""
    D = residual.shape[1]
    means = [np.tile(values.mean(axis=1, keepdims=True), (1, D)) for values in (residual, floor)]
    return _floor_noise(means[0], previous_noise, means[1])


def _initial_components(S: Float[Array, "K D D"], factors: int) -> LatentCovariances:
    """Principal components, each of at least a faint length."""
    latent = principal_components(S, np.full(len(S), factors))
    if not factors:
        return latent
    lengths = np.linalg.norm(latent.loadings, axis=1)  # (K, L)
    floor = np.sqrt(MIN_LOADING_RATIO * latent.noise[:, :1])
    directions = np.linalg.eigh(S)[1][:, :, ::-1][:, :, :factors]
    return LatentCovariances(directions * np.maximum(lengths, floor)[:, None, :], latent.noise)


def _initial_standardised_components(
    S: Float[Array, "K D D"], factors: int, floor: float
) -> LatentCovariances:
    """Principal components of the columns scaled to unit variance, in the units of the columns."""
    scale = np.sqrt(np.diagonal(S, axis1=1, axis2=2))  # (K, D)
    start = _initial_components(S / (scale[:, :, None] * scale[:, None, :]), factors)
    noise = np.maximum(1.0 - (start.loadings**2).sum(axis=2), floor)
    return LatentCovariances(start.loadings * scale[:, :, None], noise * scale**2)


def _validate_settings(name: str, factors: int, sweeps: int, min_noise: float) -> None:
    require_count(factors, name, MAX_COUNT)
    require_count(sweeps, "sweeps", MAX_COUNT, 1)
    if not 0.0 < require_number(min_noise, "min_noise") < 1.0:
        raise InvalidInput(f"least_noise is {min_noise}, expected a share between 0 and 1, say 1e-8")


def _validate_variance(variances: Float[Array, "K D"]) -> None:
    if (degenerate := np.argwhere(~(variances > 0.0))).size:
        k, column = degenerate[0]
        raise NotPositiveDefinite(
            f"the covariance of state {k} is not positive definite: column {column} (first is 0) has the "
            f"variance {variances[k, column]:.3g}; raise the regularisation, drop constant columns, "
            "or give more data"
        )
