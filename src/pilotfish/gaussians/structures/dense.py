"""Covariances that are estimated directly from sample covariances: full, diagonal and spherical."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky
from pilotfish.gaussians.structures.structure import Covariances, CovarianceStructure, validate_symmetry
from pilotfish.types import Array, Float
from pilotfish.validation import float_array, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class DenseCovariances(Covariances):
    """Covariances stored as matrices.

    Attributes:
        dense: Symmetric positive definite matrices.
    """

    kind: ClassVar[str] = "dense"
    dense: Float[Array, "K D D"]

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        return precision_cholesky(self.dense, name)

    def validate_parameters(self, name: str) -> None:
        validate_symmetry(self.dense, name)


@dataclass(frozen=True, slots=True)
class Full(CovarianceStructure):
    """Structure in which every state has its own unrestricted covariance."""

    name: ClassVar[str] = "full"
    covariances: ClassVar[type[Covariances]] = DenseCovariances

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> DenseCovariances:
        return DenseCovariances(sample_covariances)

    def parameter_count(self, states: int, width: int) -> int:
        return states * width * (width + 1) // 2


@dataclass(frozen=True, slots=True)
class Diagonal(CovarianceStructure):
    """Structure in which every state has its own variance in each column; columns are uncorrelated."""

    name: ClassVar[str] = "diagonal"
    covariances: ClassVar[type[Covariances]] = DenseCovariances

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> DenseCovariances:
        return DenseCovariances(sample_covariances * np.eye(sample_covariances.shape[-1]))

    def parameter_count(self, states: int, width: int) -> int:
        return states * width


@dataclass(frozen=True, slots=True)
class Spherical(CovarianceStructure):
    """Structure in which every state has one variance, the same in all columns."""

    name: ClassVar[str] = "spherical"
    covariances: ClassVar[type[Covariances]] = DenseCovariances

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> DenseCovariances:
        variances = np.trace(sample_covariances, axis1=1, axis2=2) / sample_covariances.shape[-1]  # (K,)
        return DenseCovariances(variances[:, None, None] * np.eye(sample_covariances.shape[-1]))

    def parameter_count(self, states: int, width: int) -> int:
        return states


def component_correlation(covariances: Float[Array, "K D D"]) -> Float[Array, "K K"]:
    """Return the correlation coefficient between the entries of each pair of covariances, in [-1, 1].

    It is near one for components that share their directions of variation, and NaN for a covariance whose
    entries are all equal.

    Args:
        covariances: Covariance of each component.

    Raises:
        InvalidInput: If covariances are not finite or have another shape.

    Source:
        Tanwani 2018, equation 4.25.
    """
    covariances = float_array(covariances, "covariances")
    if covariances.ndim != 3 or not covariances.size:
        raise InvalidInput(f"covariances has shape {covariances.shape}, expected (K, D, D)")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.atleast_2d(np.corrcoef(covariances.reshape(len(covariances), -1)))
