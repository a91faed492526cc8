"""Planning: an adapted model and a horizon become the targets and weights that a controller tracks. This is
the only place where a model's precision turns into a tracking weight.
"""

from pilotfish.planning.plan import expected_plan, plan, planned_states, reference

__all__ = ["expected_plan", "plan", "planned_states", "reference"]
