"""Manipulation tasks, each a value: what stands in the workcell, where, and when the work is done."""

from pilotfish.environments.tasks.carabiner import CARABINER
from pilotfish.environments.tasks.catalogue import TASKS
from pilotfish.environments.tasks.plate import PLATE
from pilotfish.environments.tasks.recorded_valve import RECORDED_VALVE, RecordedValve
from pilotfish.environments.tasks.screwdriver import SCREWDRIVER
from pilotfish.environments.tasks.stab import STAB
from pilotfish.environments.tasks.task import Outcome, Scene, Task
from pilotfish.environments.tasks.valve import VALVE

__all__ = [
    "CARABINER",
    "PLATE",
    "RECORDED_VALVE",
    "SCREWDRIVER",
    "STAB",
    "TASKS",
    "VALVE",
    "Outcome",
    "RecordedValve",
    "Scene",
    "Task",
]
