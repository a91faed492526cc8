"""Planning: from an adapted skill to targets and weights (`plan`), and to a whole motion (`reproduce`).

`via_point` and `condition_on` draw a plan through given points, `tangent_chart` plans orientations on S^3,
and `reproduce_step` plans again each period while the objects move. `select_by_reproduction` compares models
by the motions that they make.
"""

from pilotfish.planning.conditioning import condition_on
from pilotfish.planning.costs import default_control_cost, default_covariance_regularisation
from pilotfish.planning.evaluation import (
    end_orientation_error,
    end_position_error,
    largest_acceleration,
    mean_squared_error,
    reproduce_demonstration,
    time_warped_distance,
)
from pilotfish.planning.motion_notes import motion_notes
from pilotfish.planning.moving import moving_frames, reproduce_step
from pilotfish.planning.plan import plan, plan_states
from pilotfish.planning.reproduction import (
    Reproduction,
    mean_demonstration_length,
    reproduce,
    reproduce_adapted,
)
from pilotfish.planning.selection import (
    DEFAULT_CANDIDATE,
    MAX_FOLDS,
    ReproductionScore,
    ReproductionSelection,
    default_candidates,
    held_out_errors,
    select_by_reproduction,
)
from pilotfish.planning.tangent_chart import TangentChart, tangent_chart
from pilotfish.planning.via_points import ViaPoint, ViaPointObservation, observe_via_points, via_point

__all__ = [
    "DEFAULT_CANDIDATE",
    "MAX_FOLDS",
    "Reproduction",
    "ReproductionScore",
    "ReproductionSelection",
    "TangentChart",
    "ViaPoint",
    "ViaPointObservation",
    "condition_on",
    "default_candidates",
    "default_control_cost",
    "default_covariance_regularisation",
    "end_orientation_error",
    "end_position_error",
    "held_out_errors",
    "largest_acceleration",
    "mean_demonstration_length",
    "mean_squared_error",
    "motion_notes",
    "moving_frames",
    "observe_via_points",
    "plan",
    "plan_states",
    "reproduce",
    "reproduce_adapted",
    "reproduce_demonstration",
    "reproduce_step",
    "select_by_reproduction",
    "tangent_chart",
    "time_warped_distance",
    "via_point",
]
