"""Model of a person who guides a robot arm by hand, or operates it from a picture that may be delayed.

A person is a set of numbers, `HumanModel`. `step_human` is a pure step: (plan, state, observation) -> state.
The pose of the hand in the state is the tool pose that the person commands.
"""

from pilotfish.environments.human.demonstration_plan import DemonstrationPlan, Observation, Subtask
from pilotfish.environments.human.human_model import HumanModel
from pilotfish.environments.human.human_state import HumanState, initial_state
from pilotfish.environments.human.step_human import step_human

__all__ = [
    "DemonstrationPlan",
    "HumanModel",
    "HumanState",
    "Observation",
    "Subtask",
    "initial_state",
    "step_human",
]
