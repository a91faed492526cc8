"""Mixtures of factor analysers (MFA) and of probabilistic principal component analysers (MPPCA)."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures.latent import (
    LatentCovariances,
    em_step,
    principal_components,
    validate_factor_count,
    warm_start,
)
from pilotfish.gaussians.structures.structure import MAX_COUNT, Covariances, CovarianceStructure
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number

MIN_LOADING_RATIO = 1e-3  # squared initial loading relative to the noise: a loading of zero would never grow


@dataclass(frozen=True, slots=True)
class MFA(CovarianceStructure):
    """Structure in which every state has its own factors, and every column its own noise.

    The result does not depend on the units of the columns, unlike with MPPCA and HDDC.

    Attributes:
        factors: Number of factors of each state, less than the number of columns.
        sweeps: EM steps in every M-step. Each raises the likelihood and the next M-step continues from the
            same factors, so that few are enough.
        min_noise: Lower bound of the noise of a column, as a fraction of its variance. Without a bound the
            noise may go to zero (a Heywood case).

    Source:
        Ghahramani & Hinton 1996; Tanwani 2018, section 4.1.2.
    """

    name: ClassVar[str] = "mfa"
    covariances: ClassVar[type[Covariances]] = LatentCovariances
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
        variances = _positive_variances(sample_covariances)
        noise = partial(_floor_noise, floor=self.min_noise * variances)
        latent = warm_start(previous, sample_covariances, self.factors)
        if latent is None:
            latent = _initial_standardised_components(sample_covariances, self.factors, self.min_noise)
        for _ in range(self.sweeps):
            latent = em_step(sample_covariances, latent, noise)
        return latent

    def parameter_count(self, states: int, width: int) -> int:
        """Return D d loadings and D noise variances for each state, as in table 5.1 of the thesis.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return states * width * (self.factors + 1)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return the parameters less d (d - 1) / 2 for each state: the factors may be rotated.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        rotations = self.factors * (self.factors - 1) // 2
        return states * min(width * (self.factors + 1) - rotations, width * (width + 1) // 2)


@dataclass(frozen=True, slots=True)
class MPPCA(CovarianceStructure):
    """Structure in which every state has its own principal components, and one noise for all columns.

    The M-step is the iteration of Tipping & Bishop, without an eigendecomposition; HDDC has the same
    covariances in closed form. Columns should have comparable units, since they share their noise.

    Attributes:
        components: Number of components of each state, less than the number of columns.
        sweeps: EM steps in every M-step, as in MFA.
        min_noise: Lower bound of the noise, as a fraction of the mean variance of the columns.

    Source:
        Tipping & Bishop 1999, Mixtures of probabilistic principal component analysers; Tanwani 2018,
        equations 4.14-4.16, corrected.
    """

    name: ClassVar[str] = "mppca"
    covariances: ClassVar[type[Covariances]] = LatentCovariances
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
        variances = _positive_variances(sample_covariances)
        noise = partial(_floor_shared_noise, floor=self.min_noise * variances)
        latent = warm_start(previous, sample_covariances, self.components)
        if latent is None:
            latent = _initial_components(sample_covariances, self.components)
        for _ in range(self.sweeps):
            latent = em_step(sample_covariances, latent, noise)
        return latent

    def parameter_count(self, states: int, width: int) -> int:
        """Return D d loadings and one noise variance for each state.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return states * (width * self.components + 1)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return the parameters less d (d - 1) / 2 for each state: the components may be rotated.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return states * (width * self.components + 1 - self.components * (self.components - 1) // 2)


def _floor_noise(
    residual: Float[Array, "K D"], previous_noise: Float[Array, "K D"], floor: Float[Array, "K D"]
) -> Float[Array, "K D"]:
    """Return the residual variances, bounded below by the floor or by smaller previous noise.

    The likelihood of the noise of a column has one maximum, at the residual variance. Stopping at the floor
    on the way to it therefore does not lower the likelihood.
    """
    return np.asarray(np.maximum(residual, np.minimum(previous_noise, floor)))


def _floor_shared_noise(
    residual: Float[Array, "K D"], previous_noise: Float[Array, "K D"], floor: Float[Array, "K D"]
) -> Float[Array, "K D"]:
    """Return the result of `_floor_noise` for one noise variance per state."""
    D = residual.shape[1]
    means = [np.tile(values.mean(axis=1, keepdims=True), (1, D)) for values in (residual, floor)]
    return _floor_noise(means[0], previous_noise, means[1])


def _initial_components(S: Float[Array, "K D D"], factors: int) -> LatentCovariances:
    """Return principal components whose loadings are not zero."""
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
    """Return principal components of columns scaled to unit variance, in the units of the columns."""
    scale = np.sqrt(np.diagonal(S, axis1=1, axis2=2))  # (K, D)
    start = _initial_components(S / (scale[:, :, None] * scale[:, None, :]), factors)
    noise = np.maximum(1.0 - (start.loadings**2).sum(axis=2), floor)
    return LatentCovariances(start.loadings * scale[:, :, None], noise * scale**2)


def _validate_settings(name: str, factors: int, sweeps: int, min_noise: float) -> None:
    require_count(factors, name, MAX_COUNT)
    require_count(sweeps, "sweeps", MAX_COUNT, 1)
    if not 0.0 < require_number(min_noise, "min_noise") < 1.0:
        raise InvalidInput(f"min_noise is {min_noise}, expected a fraction between 0 and 1, such as 1e-8")


def _positive_variances(S: Float[Array, "K D D"]) -> Float[Array, "K D"]:
    """Return the variances of the columns, or raise NotPositiveDefinite."""
    variances = np.diagonal(S, axis1=1, axis2=2)
    if (degenerate := np.argwhere(~(variances > 0.0))).size:
        k, column = degenerate[0]
        raise NotPositiveDefinite(
            f"the covariance of state {k} is not positive definite: column {column} (first is 0) has the "
            f"variance {variances[k, column]:.3g}; raise the regularisation, drop constant columns, "
            "or give more data"
        )
    return variances
