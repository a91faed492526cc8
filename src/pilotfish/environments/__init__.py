"""Worlds to act in: the two-armed robot Baxter in physics, manipulation tasks that only contact can do,
simulated people who show them and steer, and the same tasks as Gymnasium environments.
"""

from pilotfish.environments import people
from pilotfish.environments.baxter import Surface
from pilotfish.environments.cameras import NO_MARKS, VIEWS, Marks, Photographer, View, view_of
from pilotfish.environments.manipulation import Manipulation
from pilotfish.environments.steering import turn_between
from pilotfish.environments.tasks import RECORDED_VALVE, TASKS, RecordedValve, Scene, Task, Verdict
from pilotfish.environments.workcell import TICK, Workcell

__all__ = [
    "NO_MARKS",
    "RECORDED_VALVE",
    "TASKS",
    "TICK",
    "VIEWS",
    "Manipulation",
    "Marks",
    "Photographer",
    "RecordedValve",
    "Scene",
    "Surface",
    "Task",
    "Verdict",
    "View",
    "Workcell",
    "people",
    "turn_between",
    "view_of",
]
