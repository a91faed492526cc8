"""Ways to learn how states follow one another, by the names that a command line gives them."""

from functools import partial

from pilotfish import models
from pilotfish.models import Censoring, DurationLaw, Durations, Learner, Timing

COUNTED = "counted"

# To offer a law of durations, give it a name here.
LAWS: dict[str, DurationLaw] = {
    "normal": models.Normal(),
    "log-normal": models.LogNormal(),
    "gamma": models.Gamma(),
    "poisson": models.Poisson(),
    "negative-binomial": models.NegativeBinomial(),
    "histogram": models.Histogram(pseudocount=1.0),
}
LAW_NAMES: dict[type[Durations], str] = {
    models.GaussianDurations: "normal",
    models.LogNormalDurations: "log-normal",
    models.GammaDurations: "gamma",
    models.PoissonDurations: "poisson",
    models.NegativeBinomialDurations: "negative-binomial",
    models.HistogramDurations: "histogram",
}
CENSORINGS = {
    "last": Censoring(first=False, last=True),
    "first": Censoring(first=True, last=False),
    "both": Censoring(first=True, last=True),
    "none": Censoring(first=False, last=False),
}
LEARNERS: dict[str, Learner] = {
    COUNTED: models.learn,
    **{name: partial(models.learn_semi_markov, timing=Timing(law)) for name, law in LAWS.items()},
    "markov": models.learn_markov,
    "mixture": models.learn_mixture,
}


def semi_markov_learner(durations: str, censored: str) -> Learner:
    """Learns semi-Markov skills whose durations are of the law of that name, or counted afterwards."""
    if durations == COUNTED:
        return models.learn
    return partial(models.learn_semi_markov, timing=Timing(LAWS[durations], CENSORINGS[censored]))
