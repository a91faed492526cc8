"""Models of a skill: mixture, Markov and semi-Markov dynamics over states that several frames see. They are
learned by a fold of statistics, adapted to where objects stand, and unrolled into state sequences.
"""

from pilotfish.models import online
from pilotfish.models.adapt import adapt
from pilotfish.models.agreement import matched_accuracy, matching, normalised_mutual_information
from pilotfish.models.duration_laws import DurationLaw, Gamma, Histogram, LogNormal, Normal, Poisson
from pilotfish.models.duration_negative_binomial import NegativeBinomial
from pilotfish.models.durations import (
    Durations,
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormalDurations,
    NegativeBinomialDurations,
    PoissonDurations,
)
from pilotfish.models.durations_counted import runs, with_durations
from pilotfish.models.dynamics import (
    Censoring,
    Dynamics,
    MarkovChain,
    SemiMarkovChain,
    Weights,
)
from pilotfish.models.em import MOST_ITERATIONS, MOST_RESTARTS, EMSettings, Outcome, Run, improve
from pilotfish.models.forward import LONGEST_PLAN, Forward, markov_forward, occupancy, semi_markov_forward
from pilotfish.models.freedom import free_dynamics, free_parameters
from pilotfish.models.learn import Fit, learn, learn_markov, learn_mixture
from pilotfish.models.learn_semi_markov import Timing, learn_semi_markov, most_likely_semi_markov
from pilotfish.models.posteriors import posteriors
from pilotfish.models.regression import as_mixture, filtered_regression, smoothed_regression
from pilotfish.models.relevance import FrameRelevance, relevance, select_frames
from pilotfish.models.selection import Candidate, Failure, Learner, Score, Selection, bic, select
from pilotfish.models.sequences import (
    log_emissions,
    log_likelihood,
    log_likelihood_of_states,
    most_probable_states,
    sample_states,
    viterbi,
)
from pilotfish.models.signs import on_the_half_of
from pilotfish.models.size import (
    covariance_freedom,
    covariance_parameters,
    fitted_parameters,
    semi_markov_parameters,
)
from pilotfish.models.skill import (
    MOST_SKILL_NUMBERS,
    MOST_STATES,
    AdaptedSkill,
    HiddenModel,
    Provenance,
    Skill,
)
from pilotfish.models.starts import Given, KMeans, Start, TimeBins
from pilotfish.models.statistics import (
    Statistics,
    further_statistics,
    labelled_statistics,
    maximise,
    most_likely_chain,
    most_likely_weights,
    statistics,
)
from pilotfish.models.visits import Visits

__all__ = [
    "LONGEST_PLAN",
    "MOST_ITERATIONS",
    "MOST_RESTARTS",
    "MOST_SKILL_NUMBERS",
    "MOST_STATES",
    "AdaptedSkill",
    "Candidate",
    "Censoring",
    "DurationLaw",
    "Durations",
    "Dynamics",
    "EMSettings",
    "Failure",
    "Fit",
    "Forward",
    "FrameRelevance",
    "Gamma",
    "GammaDurations",
    "GaussianDurations",
    "Given",
    "HiddenModel",
    "Histogram",
    "HistogramDurations",
    "KMeans",
    "Learner",
    "LogNormal",
    "LogNormalDurations",
    "MarkovChain",
    "NegativeBinomial",
    "NegativeBinomialDurations",
    "Normal",
    "Outcome",
    "Poisson",
    "PoissonDurations",
    "Provenance",
    "Run",
    "Score",
    "Selection",
    "SemiMarkovChain",
    "Skill",
    "Start",
    "Statistics",
    "TimeBins",
    "Timing",
    "Visits",
    "Weights",
    "adapt",
    "as_mixture",
    "bic",
    "covariance_freedom",
    "covariance_parameters",
    "filtered_regression",
    "fitted_parameters",
    "free_dynamics",
    "free_parameters",
    "further_statistics",
    "improve",
    "labelled_statistics",
    "learn",
    "learn_markov",
    "learn_mixture",
    "learn_semi_markov",
    "log_emissions",
    "log_likelihood",
    "log_likelihood_of_states",
    "markov_forward",
    "matched_accuracy",
    "matching",
    "maximise",
    "most_likely_chain",
    "most_likely_semi_markov",
    "most_likely_weights",
    "most_probable_states",
    "normalised_mutual_information",
    "occupancy",
    "on_the_half_of",
    "online",
    "posteriors",
    "relevance",
    "runs",
    "sample_states",
    "select",
    "select_frames",
    "semi_markov_forward",
    "semi_markov_parameters",
    "smoothed_regression",
    "statistics",
    "viterbi",
    "with_durations",
]
