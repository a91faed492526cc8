"""What a task is: objects in a workcell, where they may be, and when the task is done."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import mujoco
import numpy as np

from pilotfish.environments.baxter.tools import Tool
from pilotfish.environments.human import Subtask
from pilotfish.environments.scene_renderer import FRONT_RIGHT, CameraView
from pilotfish.environments.tasks.progress import Progress
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.geometry import Pose
from pilotfish.validation import shorten_repr

S = TypeVar("S")


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Task(Generic[S]):
    """Manipulation task whose situations are values of type S; poses are in torso axes.

    Attributes:
        name: Name on the command line.
        description: What is to be done.
        frames: Names of the task's frames.
        has_gripper: Whether the tool opens and closes.
        unit: Unit of the error.
        time_limit: Longest duration of an attempt [s].
        mount_tool: Function (model, hand, side) that mounts the tool.
        sample_situation: Function that samples a situation.
        add_objects: Function (model, situation) that adds the objects.
        start_pose: Function from the situation to the tool pose at the start.
        observe_frames: Function (model, state, situation) that returns the pose of each frame.
        check_success: Function (scene, situation) that returns the outcome.
        demonstration_script: Function from the situation to the subtasks of a demonstration.
        fragile_geoms: Names of geoms whose contact forces are measured.
        view: Camera for images of the task.
        actuate_scene: Function (model, state, situation, time) that moves objects; None if nothing moves.
        progress: How progress is measured and a failure explained; None for the outcome's reason only.
    """

    name: str
    description: str
    frames: tuple[str, ...]
    has_gripper: bool
    unit: str
    time_limit: float
    mount_tool: Callable[[mujoco.MjSpec, mujoco.MjsBody, str], Tool]
    sample_situation: Callable[[np.random.Generator], S]
    add_objects: Callable[[mujoco.MjSpec, S], None]
    start_pose: Callable[[S], Pose]
    observe_frames: Callable[[mujoco.MjModel, mujoco.MjData, S], dict[str, Pose]]
    check_success: Callable[[Scene, S], Outcome]
    demonstration_script: Callable[[S], tuple[Subtask, ...]]
    fragile_geoms: tuple[str, ...] = ()
    view: CameraView = FRONT_RIGHT
    actuate_scene: Callable[[mujoco.MjModel, mujoco.MjData, S, float], None] | None = None
    progress: Progress[S] | None = None
