"""Planning: an adapted model and a horizon become the targets and weights that a controller tracks. This is
the only place where a model's precision turns into a tracking weight.
"""

from pilotfish.planning.chart import Chart, chart
from pilotfish.planning.moving import moving_reference
from pilotfish.planning.plan import expected_plan, plan, planned_states, reference
from pilotfish.planning.through import plan_through, through
from pilotfish.planning.via_points import Observation, ViaPoint, observations, on_chart, via_point

__all__ = [
    "Chart",
    "Observation",
    "ViaPoint",
    "chart",
    "expected_plan",
    "moving_reference",
    "observations",
    "on_chart",
    "plan",
    "plan_through",
    "planned_states",
    "reference",
    "through",
    "via_point",
]
