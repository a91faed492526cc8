"""Learning from a stream: datapoints are used once and dropped, and clusters, subspaces, transitions and
durations grow with them. A model is a value; what it has learned reads out as a skill like any other.
"""

from pilotfish.models.online.assignments import Assignment, Assignments, identities_now
from pilotfish.models.online.from_batch import begin_from, penalties_from
from pilotfish.models.online.model import OnlineModel, online_model
from pilotfish.models.online.observe import (
    begin_demonstration,
    observe,
    observe_demonstration,
    observe_stream,
)
from pilotfish.models.online.read_out import read_out
from pilotfish.models.online.scaling import Scales, scaled, scales_from, unscaled
from pilotfish.models.online.settings import (
    DPGMM,
    DPMPPCA,
    HDPHSMM,
    LARGEST_BATCH,
    MOST_SPARE,
    SOSC,
    Constant,
    Count,
    OnlineSettings,
    Trace,
    Upkeep,
    Weighting,
)

__all__ = [
    "DPGMM",
    "DPMPPCA",
    "HDPHSMM",
    "LARGEST_BATCH",
    "MOST_SPARE",
    "SOSC",
    "Assignment",
    "Assignments",
    "Constant",
    "Count",
    "OnlineModel",
    "OnlineSettings",
    "Scales",
    "Trace",
    "Upkeep",
    "Weighting",
    "begin_demonstration",
    "begin_from",
    "identities_now",
    "observe",
    "observe_demonstration",
    "observe_stream",
    "online_model",
    "penalties_from",
    "read_out",
    "scaled",
    "scales_from",
    "unscaled",
]
