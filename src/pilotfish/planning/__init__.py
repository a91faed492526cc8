"""Planning: an adapted skill and a horizon become targets and weights, and `reproduce` a whole motion."""

from pilotfish.planning.conditioning import condition_on
from pilotfish.planning.evaluation import (
    end_orientation_error,
    end_position_error,
    largest_acceleration,
    mean_squared_error,
    reproduce_demonstration,
)
from pilotfish.planning.moving import extrapolate_pose, moving_frame_reference, moving_frames, reproduce_step
from pilotfish.planning.plan import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    plan,
    plan_states,
    reference_from_states,
)
from pilotfish.planning.reproduction import Reproduction, mean_demonstration_length, reproduce
from pilotfish.planning.tangent_chart import TangentChart, tangent_chart
from pilotfish.planning.via_points import (
    ViaPoint,
    ViaPointObservation,
    observe_via_points,
    via_point,
    via_point_to_tangent,
)

__all__ = [
    "CONTROL_COST",
    "COVARIANCE_REGULARISATION",
    "Reproduction",
    "TangentChart",
    "ViaPoint",
    "ViaPointObservation",
    "condition_on",
    "end_orientation_error",
    "end_position_error",
    "extrapolate_pose",
    "largest_acceleration",
    "mean_demonstration_length",
    "mean_squared_error",
    "moving_frame_reference",
    "moving_frames",
    "observe_via_points",
    "plan",
    "plan_states",
    "reference_from_states",
    "reproduce",
    "reproduce_demonstration",
    "reproduce_step",
    "tangent_chart",
    "via_point",
    "via_point_to_tangent",
]
