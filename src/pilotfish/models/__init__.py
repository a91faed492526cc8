"""Task-parameterised models of skills: TP-GMM, TP-HMM and TP-HSMM.

The states of a Gaussian mixture, a hidden Markov or a hidden semi-Markov model are observed from several
frames. They are learned by expectation-maximisation, adapted to new frames, and evaluated as state sequences.
"""

from pilotfish.models import online
from pilotfish.models.active_bounds import structure_notes
from pilotfish.models.adapt import adapt
from pilotfish.models.agreement import match_labels, matched_accuracy, normalised_mutual_information
from pilotfish.models.degrees_of_freedom import (
    semi_markov_parameter_count,
)
from pilotfish.models.demonstrated_ranges import (
    FrameRanges,
    MotionRanges,
    coordinate_parts,
    frame_angle,
    measure_motion,
)
from pilotfish.models.demonstration_statistics import (
    DemonstrationStatistics,
    default_regularisation,
    demonstration_statistics,
    part_scales,
)
from pilotfish.models.duration_model import Censoring, DurationModel
from pilotfish.models.dynamics import MAX_HORIZON, MarkovChain, MixtureWeights
from pilotfish.models.em import (
    Convergence,
    EMSettings,
    expected_statistics,
    fit_em,
    maximise_likelihood,
)
from pilotfish.models.frame_relevance import FrameRelevance, relevance, select_frames
from pilotfish.models.initialisation import FromModel, KMeans, Template, TimeBins
from pilotfish.models.learn import default_states, default_structure, learn
from pilotfish.models.learning_problem import Fit
from pilotfish.models.partitions import PARTITION_SIZE, DemonstrationGroup, InProcess, Partitions, partition
from pilotfish.models.regression import filtered_regression, smoothed_regression
from pilotfish.models.selection import VITERBI, Candidate, Score, Selection, require_selection, select
from pilotfish.models.semi_markov import Dynamics, SemiMarkovChain
from pilotfish.models.sequences import (
    log_emissions,
    log_likelihood,
    state_segments,
    viterbi,
)
from pilotfish.models.signs import align_quaternion_signs
from pilotfish.models.skill import MAX_STATES, AdaptedSkill, Endpoints, HiddenModel, Provenance, Skill
from pilotfish.models.statistics import Statistics

__all__ = [
    "MAX_HORIZON",
    "MAX_STATES",
    "PARTITION_SIZE",
    "VITERBI",
    "AdaptedSkill",
    "Candidate",
    "Censoring",
    "Convergence",
    "DemonstrationGroup",
    "DemonstrationStatistics",
    "DurationModel",
    "Dynamics",
    "EMSettings",
    "Endpoints",
    "Fit",
    "FrameRanges",
    "FrameRelevance",
    "FromModel",
    "HiddenModel",
    "InProcess",
    "KMeans",
    "MarkovChain",
    "MixtureWeights",
    "MotionRanges",
    "Partitions",
    "Provenance",
    "Score",
    "Selection",
    "SemiMarkovChain",
    "Skill",
    "Statistics",
    "Template",
    "TimeBins",
    "adapt",
    "align_quaternion_signs",
    "coordinate_parts",
    "default_regularisation",
    "default_states",
    "default_structure",
    "demonstration_statistics",
    "expected_statistics",
    "filtered_regression",
    "fit_em",
    "frame_angle",
    "learn",
    "log_emissions",
    "log_likelihood",
    "match_labels",
    "matched_accuracy",
    "maximise_likelihood",
    "measure_motion",
    "normalised_mutual_information",
    "online",
    "part_scales",
    "partition",
    "relevance",
    "require_selection",
    "select",
    "select_frames",
    "semi_markov_parameter_count",
    "smoothed_regression",
    "state_segments",
    "structure_notes",
    "viterbi",
]
