"""Discretised gamma durations."""

from dataclasses import dataclass
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

SHAPE_BOUNDS = (-0.99, 1e6)  # of the shape minus one


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Gamma(DurationDistribution):
    """Gamma density s^(shape - 1) exp(-rate s) at whole steps s >= 1, normalised over them.

    Attributes:
        shapes: Shape of every state.
        rates: Rate of every state [1/step].
    """

    name: ClassVar[str] = "gamma"
    shapes: Float[Array, " K"]
    rates: Float[Array, " K"]

    @classmethod
    def fit(
        cls, segments: Segments, previous: DurationDistribution | None = None, min_variance: float = 1.0
    ) -> "Gamma":
        """Estimate the parameters from expected segments.

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration.
            min_variance: Lower bound of the variance about the mean recorded length [steps^2].

        Returns:
            The maximum-likelihood distribution.
        """
        warm_start = isinstance(previous, Gamma)
        recorded_means, variances = segments.recorded_length_moments()
        if isinstance(previous, Gamma):
            shapes, rates = previous.shapes, previous.rates
        else:
            rates = recorded_means / np.maximum(variances, min_variance)
            shapes = recorded_means * rates
        theta = np.stack([shapes - 1.0, -rates])
        family = bounded_family(
            lambda s: np.stack([np.log(s), s], axis=1),
            zero_log_base,
            theta,
            (SHAPE_BOUNDS[0], -recorded_means / min_variance),
            (SHAPE_BOUNDS[1], -1.0 / (MAX_RELATIVE_DURATION * len(segments.uncensored))),
        )
        shapes_minus_one, negative_rates = fit_parameters(family, segments, theta, warm_start)
        return cls(1.0 + shapes_minus_one, -negative_rates)

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(np.outer(self.shapes - 1.0, np.log(steps)) - np.outer(self.rates, steps)).T

    def validate(self) -> None:
        require_positive(self.shapes, "durations.shapes")
        require_positive(self.rates, "durations.rates")
