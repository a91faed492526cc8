"""Learning from a stream: datapoints are used once and dropped, and clusters, subspaces, transitions and
durations grow with them. A model is a value; what it has learned reads out as a skill like any other.
"""

from pilotfish.models.online.assignments import Assignment, Assignments, current_cluster_ids
from pilotfish.models.online.from_batch import estimate_penalties, from_batch_fit
from pilotfish.models.online.model import OnlineModel, online_model
from pilotfish.models.online.observe import (
    begin_demonstration,
    observe,
    observe_demonstration,
    observe_stream,
)
from pilotfish.models.online.read_out import to_skill
from pilotfish.models.online.scaling import ColumnScales, estimate_scales, scale_demonstration, unscale_skill
from pilotfish.models.online.settings import (
    DPGMM,
    DPMPPCA,
    HDPHSMM,
    MAX_BATCH_SIZE,
    MAX_EXTRA_DIRECTIONS,
    SOSC,
    ConstantWeight,
    DatapointCount,
    ExponentialDecay,
    Maintenance,
    OnlineSettings,
    Weighting,
)

__all__ = [
    "DPGMM",
    "DPMPPCA",
    "HDPHSMM",
    "MAX_BATCH_SIZE",
    "MAX_EXTRA_DIRECTIONS",
    "SOSC",
    "Assignment",
    "Assignments",
    "ColumnScales",
    "ConstantWeight",
    "DatapointCount",
    "ExponentialDecay",
    "Maintenance",
    "OnlineModel",
    "OnlineSettings",
    "Weighting",
    "begin_demonstration",
    "current_cluster_ids",
    "estimate_penalties",
    "estimate_scales",
    "from_batch_fit",
    "observe",
    "observe_demonstration",
    "observe_stream",
    "online_model",
    "scale_demonstration",
    "to_skill",
    "unscale_skill",
]
