"""Models of a skill: mixture, Markov and semi-Markov dynamics over states that several frames see. They are
learned by a fold of statistics, adapted to where objects stand, and unrolled into state sequences.
"""

from pilotfish.models import online
from pilotfish.models.adapt import adapt
from pilotfish.models.agreement import match_labels, matched_accuracy, normalised_mutual_information
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
from pilotfish.models.dynamics import (
    Censoring,
    Dynamics,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
)
from pilotfish.models.em import MAX_ITERATIONS, MAX_RESTARTS, Convergence, EMRun, EMSettings, fit_em
from pilotfish.models.forward import (
    MAX_HORIZON,
    ForwardVariables,
    filtered_state_probs,
    markov_forward,
    semi_markov_forward,
)
from pilotfish.models.frame_relevance import FrameRelevance, relevance, select_frames
from pilotfish.models.freedom import degrees_of_freedom, dynamics_degrees_of_freedom
from pilotfish.models.learn import Fit, learn, learn_markov, learn_mixture
from pilotfish.models.learn_semi_markov import DurationModel, fit_semi_markov_chain, learn_semi_markov
from pilotfish.models.posteriors import smoothed_state_probs
from pilotfish.models.regression import as_mixture, filtered_regression, smoothed_regression
from pilotfish.models.segments import Segments
from pilotfish.models.selection import Candidate, FailedCandidate, Learner, Score, Selection, bic, select
from pilotfish.models.sequences import (
    log_emissions,
    log_likelihood,
    log_state_likelihoods,
    most_probable_states,
    sample_states,
    viterbi,
)
from pilotfish.models.signs import align_quaternion_signs
from pilotfish.models.size import (
    covariance_degrees_of_freedom,
    covariance_parameter_count,
    fitted_covariance_parameter_count,
    semi_markov_parameter_count,
)
from pilotfish.models.skill import (
    MAX_SKILL_NUMBERS,
    MAX_STATES,
    AdaptedSkill,
    HiddenModel,
    Provenance,
    Skill,
)
from pilotfish.models.starts import FromModel, Initialisation, KMeans, TimeBins
from pilotfish.models.statistics import (
    Statistics,
    expected_statistics,
    fit_markov_chain,
    fit_mixture_weights,
    labelled_statistics,
    maximise_likelihood,
    monotone_statistics,
)

__all__ = [
    "MAX_HORIZON",
    "MAX_ITERATIONS",
    "MAX_RESTARTS",
    "MAX_SKILL_NUMBERS",
    "MAX_STATES",
    "AdaptedSkill",
    "Candidate",
    "Censoring",
    "Convergence",
    "DurationDistribution",
    "DurationModel",
    "Durations",
    "Dynamics",
    "EMRun",
    "EMSettings",
    "FailedCandidate",
    "Fit",
    "ForwardVariables",
    "FrameRelevance",
    "FromModel",
    "Gamma",
    "GammaDurations",
    "Gaussian",
    "GaussianDurations",
    "HiddenModel",
    "Histogram",
    "HistogramDurations",
    "Initialisation",
    "KMeans",
    "Learner",
    "LogNormal",
    "LogNormalDurations",
    "MarkovChain",
    "MixtureWeights",
    "NegativeBinomial",
    "NegativeBinomialDurations",
    "Poisson",
    "PoissonDurations",
    "Provenance",
    "Score",
    "Segments",
    "Selection",
    "SemiMarkovChain",
    "Skill",
    "Statistics",
    "TimeBins",
    "adapt",
    "align_quaternion_signs",
    "as_mixture",
    "bic",
    "count_durations",
    "covariance_degrees_of_freedom",
    "covariance_parameter_count",
    "degrees_of_freedom",
    "dynamics_degrees_of_freedom",
    "expected_statistics",
    "filtered_regression",
    "filtered_state_probs",
    "fit_em",
    "fit_markov_chain",
    "fit_mixture_weights",
    "fit_semi_markov_chain",
    "fitted_covariance_parameter_count",
    "labelled_statistics",
    "learn",
    "learn_markov",
    "learn_mixture",
    "learn_semi_markov",
    "log_emissions",
    "log_likelihood",
    "log_state_likelihoods",
    "markov_forward",
    "match_labels",
    "matched_accuracy",
    "maximise_likelihood",
    "monotone_statistics",
    "most_probable_states",
    "normalised_mutual_information",
    "online",
    "relevance",
    "sample_states",
    "select",
    "select_frames",
    "semi_markov_forward",
    "semi_markov_parameter_count",
    "smoothed_regression",
    "smoothed_state_probs",
    "state_segments",
    "viterbi",
]
