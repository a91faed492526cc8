"""Planning: an adapted model and a horizon become the targets and weights that a controller tracks. This is
the only place where a model's precision turns into a tracking weight.
"""

from pilotfish.planning.plan import expected_plan, plan, planned_states, reference
from pilotfish.planning.through import through
from pilotfish.planning.via_points import ViaPoint, via_point

__all__ = ["ViaPoint", "expected_plan", "plan", "planned_states", "reference", "through", "via_point"]
