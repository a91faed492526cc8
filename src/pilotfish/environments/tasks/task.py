"""What a manipulation task is: things in a workcell, where they may stand, and when the work is done."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import mujoco
import numpy as np

from pilotfish.environments.baxter import Tool
from pilotfish.environments.people import Act
from pilotfish.geometry import Pose

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether the work is done, and how far it is from that, in the task's unit."""

    success: bool
    error: float
    why: str = ""


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
    about: str
    frames: tuple[str, ...]
    grips: bool
    unit: str
    seconds: float
    fragile: tuple[str, ...]
    mount: Callable[[mujoco.MjSpec, mujoco.MjsBody, str], Tool]
    draw: Callable[[np.random.Generator], S]
    furnish: Callable[[mujoco.MjSpec, S], None]
    home: Callable[[S], Pose]
    see: Callable[[mujoco.MjModel, mujoco.MjData, S], dict[str, Pose]]
    judge: Callable[[Scene, S], Verdict]
    script: Callable[[S], tuple[Act, ...]]
    stir: Callable[[mujoco.MjModel, mujoco.MjData, S, float], None] | None = None
