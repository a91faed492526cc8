"""High-dimensional data clustering (HDDC): leading directions kept, the others made equal."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures.dense import MAX_COUNT, Covariances
from pilotfish.gaussians.structures.latent import (
    LatentCovariances,
    principal_components,
    validate_factor_count,
)
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count, require_number


@dataclass(frozen=True, slots=True)
class HDDC:
    """Every state keeps its leading eigenpairs; every other eigenvalue is the mean of the others.

    dimensions  how many are kept: one number for all states, or one for each
    This is the likeliest covariance of its kind, so that expectation-maximisation never loses likelihood.
    Columns should have comparable units.
    Source: Bouveyron, Girard & Schmid 2007; Tanwani 2018, equation 4.1.
    """

    dimensions: int | tuple[int, ...]

    def __post_init__(self) -> None:
        for dimension in self._dimension_tuple():
            require_count(dimension, "dimensions", MAX_COUNT)

    @property
    def label(self) -> str:
        return f"HDDC({','.join(map(str, self._dimension_tuple()))})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> LatentCovariances:
        dimensions = self._dimensions_per_state(len(sample_covariances))
        validate_factor_count(self.label, max(dimensions), sample_covariances.shape[1])
        return principal_components(sample_covariances, np.array(dimensions))

    def parameter_count(self, states: int, width: int) -> int:
        """D d numbers of leading directions and one mean for each state, as with MPPCA.

        Less one a state this is what table 5.1 of the thesis counts for subspaces of different size.
        """
        return sum(width * d + 1 for d in self._dimensions_per_state(states))

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """D (d - 1) / 2 fewer than parameters for each state: the directions kept are orthogonal."""
        return sum(width * d + 1 - d * (d - 1) // 2 for d in self._dimensions_per_state(states))

    def _dimension_tuple(self) -> tuple[int, ...]:
        return self.dimensions if isinstance(self.dimensions, tuple) else (self.dimensions,)

    def _dimensions_per_state(self, states: int) -> tuple[int, ...]:
        if not isinstance(self.dimensions, tuple):
            return (self.dimensions,) * states
        if len(self.dimensions) != states:
            raise InvalidInput(
                f"{self.label} names {len(self.dimensions)} dimensions for {states} states; give one number "
                "for all, or as many as there are states (a state that loses its data is dropped)"
            )
        return self.dimensions


@dataclass(frozen=True, slots=True)
class HDDCExplainedVariance:
    """HDDC that keeps, in every state, the fewest directions that hold this share of the variance.

    Within a fit a state may gain directions and never loses any, so that the likelihood never falls. How many
    there are is known after the fit: see as_fitted.
    Source: as HDDC; a share of the variance instead of their scree test.
    """

    ratio: float = 0.95

    def __post_init__(self) -> None:
        if not 0.0 < require_number(self.ratio, "ratio") < 1.0:
            raise InvalidInput(f"share is {self.ratio}, expected a number between 0 and 1, say .95")

    @property
    def label(self) -> str:
        return f"HDDC({self.ratio:g})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> LatentCovariances:
        dimensions = _count_leading_dimensions(sample_covariances, self.ratio)
        if isinstance(previous, LatentCovariances) and len(previous.noise) == len(sample_covariances):
            dimensions = np.maximum(dimensions, previous.factors)
        return principal_components(sample_covariances, dimensions)

    def parameter_count(self, states: int, width: int) -> int:
        raise self._unfitted_error()

    def degrees_of_freedom(self, states: int, width: int) -> int:
        raise self._unfitted_error()

    def with_fitted_dimensions(self, covariances: Covariances) -> HDDC:
        """HDDC with the dimensions that the states of these covariances ended with."""
        assert isinstance(covariances, LatentCovariances)  # nothing else comes out of estimate
        return HDDC(tuple(int(d) for d in covariances.factors))

    def _unfitted_error(self) -> InvalidInput:
        return InvalidInput(
            f"{self.label} has as many parameters as its data ask for; after the fit, fitted_parameters of "
            "pilotfish.models counts them"
        )


def _count_leading_dimensions(S: Float[Array, "K D D"], ratio: float) -> Int[Array, " K"]:
    """The fewest leading eigenvalues whose sum is this share of all, at most D - 1."""
    values = np.maximum(np.linalg.eigvalsh(S)[:, ::-1], 0.0)
    below_ratio = np.cumsum(values, axis=1) < ratio * values.sum(axis=1, keepdims=True)
    return np.asarray(np.minimum(below_ratio.sum(axis=1) + 1, S.shape[1] - 1), dtype=np.int64)
