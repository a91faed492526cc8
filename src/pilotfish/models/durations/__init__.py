"""Duration distributions of semi-Markov states, and their maximum-likelihood fit to censored segments."""

from pilotfish.models.durations.distribution import DurationDistribution
from pilotfish.models.durations.gamma import Gamma
from pilotfish.models.durations.gaussian import Gaussian
from pilotfish.models.durations.histogram import Histogram
from pilotfish.models.durations.log_normal import LogNormal
from pilotfish.models.durations.negative_binomial import NegativeBinomial
from pilotfish.models.durations.poisson import Poisson
from pilotfish.models.durations.registry import DISTRIBUTIONS
from pilotfish.models.durations.segments import Segments

__all__ = [
    "DISTRIBUTIONS",
    "DurationDistribution",
    "Gamma",
    "Gaussian",
    "Histogram",
    "LogNormal",
    "NegativeBinomial",
    "Poisson",
    "Segments",
]
