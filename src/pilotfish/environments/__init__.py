"""Worlds to act in: the two-armed robot Baxter in physics, manipulation tasks that only contact can do,
simulated people who show them and steer, and the same tasks as Gymnasium environments.
"""

from pilotfish.environments import human
from pilotfish.environments.baxter import VisualMesh
from pilotfish.environments.cameras import (
    CAMERA_VIEWS,
    EMPTY_OVERLAY,
    CameraView,
    Overlay,
    SceneRenderer,
    camera_view,
)
from pilotfish.environments.manipulation import Manipulation
from pilotfish.environments.tasks import RECORDED_VALVE, TASKS, Outcome, RecordedValve, Scene, Task
from pilotfish.environments.workcell import TIMESTEP, Workcell

__all__ = [
    "CAMERA_VIEWS",
    "EMPTY_OVERLAY",
    "RECORDED_VALVE",
    "TASKS",
    "TIMESTEP",
    "CameraView",
    "Manipulation",
    "Outcome",
    "Overlay",
    "RecordedValve",
    "Scene",
    "SceneRenderer",
    "Task",
    "VisualMesh",
    "Workcell",
    "camera_view",
    "human",
]
