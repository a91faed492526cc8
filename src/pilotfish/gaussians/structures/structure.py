"""Base classes of the covariance structures, and of the covariances that they estimate.

A structure is the only part of a model that differs in the M-step of expectation-maximisation. To add one,
write a file with a class that inherits from `CovarianceStructure` and list the class in registry.py. The
command line, the file format and expectation-maximisation need no change.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float

MAX_COUNT = 10_000  # of factors, directions, transforms or sweeps
SYMMETRY_TOLERANCE = 1e-8  # of a covariance, relative to its largest entry


class Covariances(ABC):
    """K covariances in the form in which their structure stores them.

    Attributes:
        kind: Name of the form in skill files.
    """

    __slots__ = ()
    kind: ClassVar[str]

    @property
    @abstractmethod
    def dense(self) -> Float[Array, "K D D"]:
        """Return the covariances as symmetric matrices."""

    @abstractmethod
    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        """Return the lower triangular matrices W with W^T W = covariance^-1.

        Args:
            name: What the covariances are; the error message begins with it.

        Raises:
            NotPositiveDefinite: If a covariance is singular; the message gives the index of the first.
        """

    def validate_parameters(self, name: str) -> None:  # noqa: B027 (nothing to check by default)
        """Check the parameters, which may come from a file; shapes are checked before.

        Args:
            name: What the covariances are; the error message begins with it.

        Raises:
            InvalidInput: If a parameter is outside its range.
        """


class CovarianceStructure(ABC):
    """How the covariances of K states are parameterised, and how they are estimated.

    Implementations are frozen dataclasses. The first field, if any, is the parameter that follows the name
    on the command line, as in `mfa:4`; it is optional there if it has a default.

    Attributes:
        name: Name on the command line.
        covariances: Class that `estimate` returns.
    """

    __slots__ = ()
    name: ClassVar[str]
    covariances: ClassVar[type[Covariances]]

    @property
    def label(self) -> str:
        """Return a short name with the parameter for tables and files, such as semi-tied(0.5)."""
        return self.name

    @abstractmethod
    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> Covariances:
        """Return covariances whose likelihood is at least that of the previous ones (M-step).

        Args:
            counts: Sum of the responsibilities of each state, N_k.
            sample_covariances: Weighted sample covariance of each state.
            previous: Covariances of the last iteration, from which the fit continues; None at the first.

        Raises:
            InvalidInput: If the structure cannot have this number of states or columns.
            NotPositiveDefinite: If the sample covariances have too little variance.
        """

    @abstractmethod
    def parameter_count(self, states: int, width: int) -> int:
        """Return the number of stored parameters of one frame, as the thesis counts them.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return the dimension of the set of covariances: parameters without redundant ones.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return self.parameter_count(states, width)

    def fitted(self, covariances: Covariances) -> "CovarianceStructure":
        """Return the structure with every number that it estimates from data fixed.

        Args:
            covariances: Result of `estimate`.
        """
        return self

    def fitted_parameter_count(self, covariances: Sequence[Covariances]) -> int:
        """Return the number of parameters of learned covariances, over all frames.

        Args:
            covariances: Covariances of each frame, learned with this structure.
        """
        return sum(self.fitted(c).parameter_count(*c.dense.shape[:2]) for c in covariances)


def validate_symmetry(dense: Float[Array, "K D D"], name: str) -> None:
    """Raise InvalidInput for a matrix that is not symmetric."""
    deviations = np.abs(dense - dense.transpose(0, 2, 1)).max(axis=(1, 2))
    largest = np.abs(dense).max(axis=(1, 2))
    if (bad := np.flatnonzero(deviations > SYMMETRY_TOLERANCE * largest)).size:
        raise InvalidInput(
            f"{name} {bad[0]} differs from its transpose by {deviations[bad[0]]:.3g}, expected symmetry"
        )


def validate_positive(values: Float[Array, "..."], name: str) -> None:
    """Raise InvalidInput for a value that is not positive."""
    if (bad := np.argwhere(~(values > 0.0))).size:
        raise InvalidInput(f"{name}{bad[0].tolist()} is {values[tuple(bad[0])]}, expected more than 0")
