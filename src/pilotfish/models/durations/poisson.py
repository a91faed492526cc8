"""Shifted Poisson durations."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.models.durations.distribution import (
    MAX_RELATIVE_DURATION,
    DurationDistribution,
    require_positive,
)
from pilotfish.models.durations.fit import bounded_family, fit_parameters
from pilotfish.models.durations.segments import Segments
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MIN_RATE = 1e-3  # mean number of steps after the first


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Poisson(DurationDistribution):
    """One step, followed by a Poisson number of steps.

    Attributes:
        rates: Mean number of steps after the first, of every state.
    """

    name: ClassVar[str] = "poisson"
    rates: Float[Array, " K"]

    @classmethod
    def fit(
        cls, segments: Segments, previous: DurationDistribution | None = None, min_variance: float = 1.0
    ) -> "Poisson":
        """Estimate the rates from expected segments.

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration.
            min_variance: Not used: the variance is the rate.

        Returns:
            The maximum-likelihood distribution.
        """
        from scipy.special import gammaln  # not at the top: importing scipy doubles the import time

        warm_start = isinstance(previous, Poisson)
        if isinstance(previous, Poisson):
            rates = previous.rates
        else:
            rates = segments.recorded_length_moments()[0] - 1.0
        max_rate = MAX_RELATIVE_DURATION * len(segments.uncensored)
        theta = np.log(np.clip(rates, MIN_RATE, max_rate))[None]
        family = bounded_family(
            lambda s: s[:, None] - 1.0,
            lambda s: -gammaln(s)[:, None],
            theta,
            (np.log(MIN_RATE),),
            (np.log(max_rate),),
        )
        return cls(np.exp(fit_parameters(family, segments, theta, warm_start)[0]))

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        from scipy.special import gammaln

        return np.asarray(np.outer(np.log(self.rates), steps - 1) - gammaln(steps)).T

    @property
    def means(self) -> Float[Array, " K"]:
        return 1.0 + self.rates

    @property
    def deviations(self) -> Float[Array, " K"]:
        return np.asarray(np.sqrt(self.rates))

    def validate(self) -> None:
        require_positive(self.rates, "durations.rates")
