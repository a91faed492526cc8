"""Discretised Gaussian durations."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from pilotfish.models.durations.distribution import (
    MAX_RELATIVE_DURATION,
    DurationDistribution,
    require_positive,
)
from pilotfish.models.durations.fit import bounded_family, fit_parameters, zero_log_base
from pilotfish.models.durations.segments import Segments
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Gaussian(DurationDistribution):
    """Gaussian density at whole steps s >= 1, normalised over them.

    Attributes:
        means: Mean of the density of every state, before truncation [steps].
        deviations: Standard deviation of the density, before truncation [steps].
    """

    name: ClassVar[str] = "gaussian"
    means: Float[Array, " K"] = field()  # without field() the property of the base class would be a default
    deviations: Float[Array, " K"] = field()

    @classmethod
    def fit(
        cls, segments: Segments, previous: DurationDistribution | None = None, min_variance: float = 1.0
    ) -> "Gaussian":
        """Estimate the parameters from expected segments; the mean is at least one step.

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration.
            min_variance: Lower bound of the variance before truncation [steps^2].

        Returns:
            The maximum-likelihood distribution.
        """
        warm_start = isinstance(previous, Gaussian)
        if isinstance(previous, Gaussian):
            means, variances = previous.means, previous.deviations**2
        else:
            means, variances = segments.recorded_length_moments()
            variances = np.maximum(variances, min_variance)
        theta = np.stack([(means - 1.0) / variances, -0.5 / variances])
        family = bounded_family(
            lambda s: np.stack([s - 1.0, (s - 1.0) ** 2], axis=1),
            zero_log_base,
            theta,
            (0.0, -0.5 / min_variance),
            (np.inf, -0.5 / (MAX_RELATIVE_DURATION * len(segments.uncensored)) ** 2),
        )
        slope, curvature = fit_parameters(family, segments, theta, warm_start)
        return cls(1.0 - 0.5 * slope / curvature, np.sqrt(-0.5 / curvature))

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(-0.5 * ((steps - self.means[:, None]) / self.deviations[:, None]) ** 2).T

    def validate(self) -> None:
        require_positive(self.deviations, "durations.deviations")
