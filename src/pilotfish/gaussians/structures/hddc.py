"""High-dimensional data clustering (HDDC): leading eigenpairs, and one variance for all other directions."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures.latent import (
    LatentCovariances,
    principal_components,
    validate_factor_count,
)
from pilotfish.gaussians.structures.structure import MAX_COUNT, Covariances, CovarianceStructure
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count


@dataclass(frozen=True, slots=True)
class HDDC(CovarianceStructure):
    """Structure in which every state keeps its leading eigenpairs; other eigenvalues become their mean.

    This is the most likely covariance of its kind, so that expectation-maximisation never loses likelihood.
    Columns should have comparable units.

    Attributes:
        dimensions: Number of leading directions: an integer for all states, or a tuple with one for each
            state. A float between 0 and 1 is a fraction of the variance instead: each state keeps the fewest
            directions that explain it. Within a fit a state may then gain directions but not lose any, so
            that the likelihood never falls; `fitted` gives the numbers afterwards.

    Source:
        Bouveyron, Girard & Schmid 2007; Tanwani 2018, equation 4.1. The explained variance replaces the
        scree test of the former.
    """

    name: ClassVar[str] = "hddc"
    covariances: ClassVar[type[Covariances]] = LatentCovariances
    dimensions: int | float | tuple[int, ...]

    def __post_init__(self) -> None:
        if isinstance(self.dimensions, float):
            if not 0.0 < self.dimensions < 1.0:
                raise InvalidInput(
                    f"dimensions is {self.dimensions}, expected a whole number, or a fraction of the "
                    "variance between 0 and 1 such as 0.95"
                )
            return
        for dimension in self.dimensions if isinstance(self.dimensions, tuple) else (self.dimensions,):
            require_count(dimension, "dimensions", MAX_COUNT)

    @property
    def label(self) -> str:
        if isinstance(self.dimensions, tuple):
            return f"HDDC({','.join(map(str, self.dimensions))})"
        return f"HDDC({self.dimensions:g})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> LatentCovariances:
        if isinstance(self.dimensions, float):
            dimensions = _count_leading_dimensions(sample_covariances, self.dimensions)
            if isinstance(previous, LatentCovariances) and len(previous.noise) == len(sample_covariances):
                dimensions = np.maximum(dimensions, previous.factors)
            return principal_components(sample_covariances, dimensions)
        dimensions = np.array(self._dimensions_per_state(len(sample_covariances)))
        validate_factor_count(self.label, int(dimensions.max()), sample_covariances.shape[1])
        return principal_components(sample_covariances, dimensions)

    def parameter_count(self, states: int, width: int) -> int:
        """Return D d + 1 for each state: the leading directions and one mean, as in MPPCA.

        For subspaces of different sizes, table 5.1 of the thesis counts one less for each state.

        Args:
            states: Number of states, K.
            width: Number of columns, D.

        Raises:
            InvalidInput: If dimensions is a fraction of the variance, or a tuple of another length.
        """
        return sum(width * d + 1 for d in self._dimensions_per_state(states))

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return the parameters less d (d - 1) / 2 for each state: the directions are orthogonal.

        Args:
            states: Number of states, K.
            width: Number of columns, D.

        Raises:
            InvalidInput: If dimensions is a fraction of the variance, or a tuple of another length.
        """
        return sum(width * d + 1 - d * (d - 1) // 2 for d in self._dimensions_per_state(states))

    def fitted(self, covariances: Covariances) -> "HDDC":
        if not isinstance(self.dimensions, float):
            return self
        assert isinstance(covariances, LatentCovariances)  # the only result of estimate
        return HDDC(tuple(int(d) for d in covariances.factors))

    def _dimensions_per_state(self, states: int) -> tuple[int, ...]:
        if isinstance(self.dimensions, float):
            raise InvalidInput(
                f"{self.label} has a number of parameters that depends on the data; count those of "
                "structure.fitted(covariances) after the fit"
            )
        if not isinstance(self.dimensions, tuple):
            return (self.dimensions,) * states
        if len(self.dimensions) != states:
            raise InvalidInput(
                f"{self.label} has {len(self.dimensions)} dimensions for {states} states; give one number "
                "for all states, or one for each state (a state that loses its data is removed)"
            )
        return self.dimensions


def _count_leading_dimensions(S: Float[Array, "K D D"], ratio: float) -> Int[Array, " K"]:
    """Return the smallest number of eigenvalues whose sum reaches the ratio, at most D - 1."""
    values = np.maximum(np.linalg.eigvalsh(S)[:, ::-1], 0.0)
    below_ratio = np.cumsum(values, axis=1) < ratio * values.sum(axis=1, keepdims=True)
    return np.asarray(np.minimum(below_ratio.sum(axis=1) + 1, S.shape[1] - 1), dtype=np.int64)
