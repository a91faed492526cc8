"""Ways to learn how states follow one another, by the names that a command line gives them."""

from functools import partial

from pilotfish import models
from pilotfish.models import Censoring, DurationDistribution, DurationModel, Durations, Learner

VITERBI = "counted"

# To offer a law of durations, give it a name here.
DISTRIBUTIONS: dict[str, DurationDistribution] = {
    "gaussian": models.Gaussian(),
    "log-normal": models.LogNormal(),
    "gamma": models.Gamma(),
    "poisson": models.Poisson(),
    "negative-binomial": models.NegativeBinomial(),
    "histogram": models.Histogram(pseudocount=1.0),
}
DISTRIBUTION_NAMES: dict[type[Durations], str] = {
    models.GaussianDurations: "gaussian",
    models.LogNormalDurations: "log-normal",
    models.GammaDurations: "gamma",
    models.PoissonDurations: "poisson",
    models.NegativeBinomialDurations: "negative-binomial",
    models.HistogramDurations: "histogram",
}
CENSORING_BY_NAME = {
    "right": Censoring(left=False, right=True),
    "left": Censoring(left=True, right=False),
    "both": Censoring(left=True, right=True),
    "none": Censoring(left=False, right=False),
}
FIT_FUNCTIONS: dict[str, Learner] = {
    VITERBI: models.learn,
    **{
        name: partial(models.learn_semi_markov, duration_model=DurationModel(distribution))
        for name, distribution in DISTRIBUTIONS.items()
    },
    "markov": models.learn_markov,
    "mixture": models.learn_mixture,
}


def semi_markov_fit_function(durations: str, censoring: str) -> Learner:
    """Learns semi-Markov skills whose durations are of the law of that name, or counted afterwards."""
    if durations == VITERBI:
        return models.learn
    return partial(
        models.learn_semi_markov,
        duration_model=DurationModel(DISTRIBUTIONS[durations], CENSORING_BY_NAME[censoring]),
    )
