"""What a manipulation task is: things in a workcell, where they may stand, and when the work is done."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import mujoco
import numpy as np

from pilotfish.environments.baxter import Tool
from pilotfish.environments.human import Subtask
from pilotfish.geometry import Pose

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Outcome:
    """Whether the work is done, and how far it is from that, in the task's unit."""

    success: bool
    error: float
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What may be judged: the physics now, the tool and its grip, the largest force [N] on fragile things."""

    model: mujoco.MjModel
    data: mujoco.MjData
    tool: Pose
    grip: float
    forces: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Task(Generic[S]):
    """A task whose situations are values of a kind S of its own; poses are seen from the torso of the robot.

    frames are the names of what it is seen from; grips tells whether the tool opens and closes; unit is that
    of the error; seconds are what an attempt may take; fragile are the shapes that nothing may push.
    """

    name: str
    description: str
    frames: tuple[str, ...]
    has_gripper: bool
    unit: str
    time_limit: float
    contact_limits: tuple[str, ...]
    mount_tool: Callable[[mujoco.MjSpec, mujoco.MjsBody, str], Tool]
    sample_situation: Callable[[np.random.Generator], S]
    add_objects: Callable[[mujoco.MjSpec, S], None]
    start_pose: Callable[[S], Pose]
    observe_frames: Callable[[mujoco.MjModel, mujoco.MjData, S], dict[str, Pose]]
    check_success: Callable[[Scene, S], Outcome]
    demonstration_script: Callable[[S], tuple[Subtask, ...]]
    actuate_scene: Callable[[mujoco.MjModel, mujoco.MjData, S, float], None] | None = None
