"""Planning: from an adapted skill to targets and weights (`plan`), and to a whole motion (`reproduce`).

`via_point` and `condition_on` draw a plan through given points, `tangent_chart` plans orientations on S^3,
and `reproduce_step` plans again each period while the objects move.
"""

from pilotfish.planning.conditioning import condition_on
from pilotfish.planning.evaluation import (
    end_orientation_error,
    end_position_error,
    largest_acceleration,
    mean_squared_error,
    reproduce_demonstration,
)
from pilotfish.planning.moving import moving_frames, reproduce_step
from pilotfish.planning.plan import CONTROL_COST, COVARIANCE_REGULARISATION, plan, plan_states
from pilotfish.planning.reproduction import Reproduction, mean_demonstration_length, reproduce
from pilotfish.planning.tangent_chart import TangentChart, tangent_chart
from pilotfish.planning.via_points import ViaPoint, ViaPointObservation, observe_via_points, via_point

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
    "largest_acceleration",
    "mean_demonstration_length",
    "mean_squared_error",
    "moving_frames",
    "observe_via_points",
    "plan",
    "plan_states",
    "reproduce",
    "reproduce_demonstration",
    "reproduce_step",
    "tangent_chart",
    "via_point",
]
