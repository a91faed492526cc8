"""Online learning from a stream: every datapoint is used once and not stored.

`estimate_settings` chooses scales and penalties, and `online_model` creates an empty model. `observe` and its
variants update it, and `to_skill` converts it to a skill. observe.py explains the method.
"""

from pilotfish.models.online.estimation import (
    ALL_DIRECTIONS,
    estimate_penalties,
    estimate_scales,
    estimate_settings,
)
from pilotfish.models.online.from_batch import from_batch_fit
from pilotfish.models.online.model import OnlineModel, begin_demonstration, online_model
from pilotfish.models.online.observe import observe, observe_demonstration, observe_stream
from pilotfish.models.online.scaling import column_scales, scale_demonstration, unscale_skill
from pilotfish.models.online.settings import (
    DPGMM,
    DPMPPCA,
    HDPHSMM,
    LEARNERS,
    SOSC,
    Maintenance,
    OnlineSettings,
    penalty_names,
)
from pilotfish.models.online.to_skill import to_skill

__all__ = [
    "ALL_DIRECTIONS",
    "DPGMM",
    "DPMPPCA",
    "HDPHSMM",
    "LEARNERS",
    "SOSC",
    "Maintenance",
    "OnlineModel",
    "OnlineSettings",
    "begin_demonstration",
    "column_scales",
    "estimate_penalties",
    "estimate_scales",
    "estimate_settings",
    "from_batch_fit",
    "observe",
    "observe_demonstration",
    "observe_stream",
    "online_model",
    "penalty_names",
    "scale_demonstration",
    "to_skill",
    "unscale_skill",
]
