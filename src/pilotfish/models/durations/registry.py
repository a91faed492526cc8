"""Duration distributions by the name that the command line, skill files and the documentation use."""

from pilotfish.models.durations.distribution import DurationDistribution
from pilotfish.models.durations.gamma import Gamma
from pilotfish.models.durations.gaussian import Gaussian
from pilotfish.models.durations.histogram import Histogram
from pilotfish.models.durations.log_normal import LogNormal
from pilotfish.models.durations.negative_binomial import NegativeBinomial
from pilotfish.models.durations.poisson import Poisson

# The first has no name in skill files: it was the only one in the first version of the format.
DISTRIBUTIONS: dict[str, type[DurationDistribution]] = {
    distribution.name: distribution
    for distribution in (Gaussian, LogNormal, Gamma, Poisson, NegativeBinomial, Histogram)
}
