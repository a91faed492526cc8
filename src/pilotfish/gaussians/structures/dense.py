"""Covariance structures: how sample covariances become the covariances of a model.

A structure is the only place where models of the family differ in their M-step. To add one, write a class
that is a Structure; expectation-maximisation needs no change.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky
from pilotfish.types import Array, Float
from pilotfish.validation import float_array

MAX_COUNT = 10_000  # of factors, directions, vectors, transforms or sweeps


@runtime_checkable
class Covariances(Protocol):
    """K covariances in whatever form their structure keeps them."""

    @property
    def dense(self) -> Float[Array, "K D D"]:
        """The same covariances written out, symmetric."""
        ...

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        """Lower triangular W with W^T W = covariance^-1.

        Raises: NotPositiveDefinite, naming the first that has none as what and its number.
        """
        ...


@runtime_checkable
class CovarianceStructure(Protocol):
    """Turns sufficient statistics into covariances."""

    @property
    def label(self) -> str:
        """A short name for tables and files, such as semi-tied(0.5)."""
        ...

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> Covariances:
        """Covariances at least as likely as previous for data of these sample covariances and masses."""
        ...

    def parameter_count(self, states: int, width: int) -> int:
        """Numbers that the covariances of one frame are made of, as the thesis counts them."""
        ...

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Dimension of what these covariances can be: parameters, less those that change no covariance."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class DenseCovariances:
    """Covariances kept written out."""

    dense: Float[Array, "K D D"]

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        return precision_cholesky(self.dense, name)


@dataclass(frozen=True, slots=True)
class Full:
    """Every state has its own unrestricted covariance."""

    @property
    def label(self) -> str:
        return "full"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> DenseCovariances:
        return DenseCovariances(sample_covariances)

    def parameter_count(self, states: int, width: int) -> int:
        return states * width * (width + 1) // 2

    def degrees_of_freedom(self, states: int, width: int) -> int:
        return self.parameter_count(states, width)


@dataclass(frozen=True, slots=True)
class Diagonal:
    """Every state has its own variance in each column; columns do not correlate."""

    @property
    def label(self) -> str:
        return "diagonal"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> DenseCovariances:
        return DenseCovariances(sample_covariances * np.eye(sample_covariances.shape[-1]))

    def parameter_count(self, states: int, width: int) -> int:
        return states * width

    def degrees_of_freedom(self, states: int, width: int) -> int:
        return self.parameter_count(states, width)


@dataclass(frozen=True, slots=True)
class Spherical:
    """Every state has one variance, the same in all columns."""

    @property
    def label(self) -> str:
        return "spherical"

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

    def degrees_of_freedom(self, states: int, width: int) -> int:
        return self.parameter_count(states, width)


def component_correlation(covariances: Float[Array, "K D D"]) -> Float[Array, "K K"]:
    """Correlation coefficient between the entries of each pair of covariances, in [-1, 1].

    Near one where components share their directions of variation.
    NaN where a covariance has all entries equal.    Source: Tanwani 2018, equation 4.25.
    """
    covariances = float_array(covariances, "covariances")
    if covariances.ndim != 3 or not covariances.size:
        raise InvalidInput(f"covariances has shape {covariances.shape}, expected (K, D, D)")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.atleast_2d(np.corrcoef(covariances.reshape(len(covariances), -1)))
