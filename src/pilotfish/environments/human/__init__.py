"""Simulated people: demonstrators and operators who watch a picture, perhaps an old one, of a tool far away
and move a hand; where the hand is, the tool is asked to be. A person is numbers, what they do a pure step.
"""

from pilotfish.environments.human.act_step import step_human
from pilotfish.environments.human.acts import (
    DemonstrationPlan,
    HandCommand,
    Observation,
    Subtask,
    within_tolerance,
)
from pilotfish.environments.human.crossover import crossover_frequency
from pilotfish.environments.human.doing import HumanState, Phase, initial_state
from pilotfish.environments.human.minimum_jerk import (
    PEAK_TO_MEAN_SPEED,
    minimum_jerk,
    minimum_jerk_acceleration,
    minimum_jerk_speed,
)
from pilotfish.environments.human.movements import Submovement, duration
from pilotfish.environments.human.person import HumanModel

__all__ = [
    "PEAK_TO_MEAN_SPEED",
    "DemonstrationPlan",
    "HandCommand",
    "HumanModel",
    "HumanState",
    "Observation",
    "Phase",
    "Submovement",
    "Subtask",
    "crossover_frequency",
    "duration",
    "initial_state",
    "minimum_jerk",
    "minimum_jerk_acceleration",
    "minimum_jerk_speed",
    "step_human",
    "within_tolerance",
]
