"""Simulate manipulation tasks in MuJoCo: the two-armed robot Baxter, tasks and human operator models.

Each task is also a Gymnasium environment. A task is done only if the physics says so: a valve turns only if
it is gripped and turned.
"""

from pilotfish.environments import human
from pilotfish.environments.contacts import contact_forces
from pilotfish.environments.fixed_camera import (
    FixedCamera,
    FixedCameraRenderer,
    PrintedMarker,
    add_camera,
    add_markers,
)
from pilotfish.environments.guidance import linear_path
from pilotfish.environments.manipulation import Manipulation
from pilotfish.environments.scene_drawings import Ellipsoid, ToolCopy
from pilotfish.environments.scene_renderer import CameraView, SceneRenderer
from pilotfish.environments.tasks.progress import (
    Failure,
    Phase,
    Progress,
    explain_failure,
    stack_measurements,
)
from pilotfish.environments.tasks.recorded_valve import RECORDED_VALVE, RecordedValve
from pilotfish.environments.tasks.registry import TASKS
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.environments.workcell import Workcell

__all__ = [
    "RECORDED_VALVE",
    "TASKS",
    "CameraView",
    "Ellipsoid",
    "Failure",
    "FixedCamera",
    "FixedCameraRenderer",
    "Manipulation",
    "Outcome",
    "Phase",
    "PrintedMarker",
    "Progress",
    "RecordedValve",
    "Scene",
    "SceneRenderer",
    "Task",
    "ToolCopy",
    "Workcell",
    "add_camera",
    "add_markers",
    "contact_forces",
    "explain_failure",
    "human",
    "linear_path",
    "stack_measurements",
]
