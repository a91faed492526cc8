"""Simulated people: demonstrators and operators who watch a picture, perhaps an old one, of a tool far away
and move a hand; where the hand is, the tool is asked to be. A person is numbers, what they do a pure step.
"""

from pilotfish.environments.people.act_step import act_step
from pilotfish.environments.people.acts import Act, Errand, Seen, Wish, within
from pilotfish.environments.people.crossover import crossover_frequency
from pilotfish.environments.people.doing import Doing, Phase, begin
from pilotfish.environments.people.minimum_jerk import (
    PEAK,
    minimum_jerk,
    minimum_jerk_acceleration,
    minimum_jerk_speed,
)
from pilotfish.environments.people.movements import Movement, duration
from pilotfish.environments.people.person import Person

__all__ = [
    "PEAK",
    "Act",
    "Doing",
    "Errand",
    "Movement",
    "Person",
    "Phase",
    "Seen",
    "Wish",
    "act_step",
    "begin",
    "crossover_frequency",
    "duration",
    "minimum_jerk",
    "minimum_jerk_acceleration",
    "minimum_jerk_speed",
    "within",
]
