"""Discretised log-normal durations."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.models.durations.distribution import DurationDistribution, require_positive
from pilotfish.models.durations.fit import bounded_family, fit_parameters
from pilotfish.models.durations.segments import Segments
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MAX_LOG_DEVIATION = 2.0  # of log s; at 2 the mean is 7.4 times the median, the deviation 54 times


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LogNormal(DurationDistribution):
    """Log-normal density at whole steps s >= 1, normalised over them: log s is Gaussian.

    Attributes:
        log_means: Mean of log s of every state, before truncation.
        log_deviations: Standard deviation of log s, before truncation.
    """

    name: ClassVar[str] = "log-normal"
    log_means: Float[Array, " K"]
    log_deviations: Float[Array, " K"]

    @classmethod
    def fit(
        cls, segments: Segments, previous: DurationDistribution | None = None, min_variance: float = 1.0
    ) -> "LogNormal":
        """Estimate the parameters from expected segments; the median is at least one step.

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration.
            min_variance: Lower bound of the variance about the mean recorded length [steps^2].

        Returns:
            The maximum-likelihood distribution.
        """
        warm_start = isinstance(previous, LogNormal)
        recorded_means, variances = segments.recorded_length_moments()
        min_log_variance = np.log1p(min_variance / recorded_means**2)
        if isinstance(previous, LogNormal):
            log_means, log_variances = previous.log_means, previous.log_deviations**2
        else:
            log_variances = np.clip(
                np.log1p(variances / recorded_means**2), min_log_variance, MAX_LOG_DEVIATION**2
            )
            log_means = np.log(recorded_means)
        theta = np.stack([log_means / log_variances, -0.5 / log_variances])
        family = bounded_family(
            lambda s: np.stack([np.log(s), np.log(s) ** 2], axis=1),
            lambda s: -np.log(s)[:, None],
            theta,
            (0.0, -0.5 / min_log_variance),
            (np.inf, -0.5 / MAX_LOG_DEVIATION**2),
        )
        slope, curvature = fit_parameters(family, segments, theta, warm_start)
        return cls(-0.5 * slope / curvature, np.sqrt(-0.5 / curvature))

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        log_s = np.log(steps)
        standardised = (log_s - self.log_means[:, None]) / self.log_deviations[:, None]
        return np.asarray(-0.5 * standardised**2 - log_s).T

    def validate(self) -> None:
        require_positive(self.log_deviations, "durations.log_deviations")
