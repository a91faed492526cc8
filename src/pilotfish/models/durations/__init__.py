"""Duration distributions of semi-Markov states."""

from pilotfish.models.durations.counted import count_durations, state_segments
from pilotfish.models.durations.distributions import (
    DurationDistribution,
    Gamma,
    Gaussian,
    Histogram,
    LogNormal,
    Poisson,
)
from pilotfish.models.durations.negative_binomial import NegativeBinomial
from pilotfish.models.durations.values import (
    Durations,
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormalDurations,
    NegativeBinomialDurations,
    PoissonDurations,
)

__all__ = [
    "DurationDistribution",
    "Durations",
    "Gamma",
    "GammaDurations",
    "Gaussian",
    "GaussianDurations",
    "Histogram",
    "HistogramDurations",
    "LogNormal",
    "LogNormalDurations",
    "NegativeBinomial",
    "NegativeBinomialDurations",
    "Poisson",
    "PoissonDurations",
    "count_durations",
    "state_segments",
]
