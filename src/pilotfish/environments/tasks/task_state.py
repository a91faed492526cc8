"""State of a task that decides about success, and its outcome."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco

from pilotfish.geometry import Pose
from pilotfish.validation import shorten_repr


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a task.

    Attributes:
        success: Whether the task is done.
        error: Remaining error in the unit of the task.
        reason: Why the task is not done; empty on success.
    """

    success: bool
    error: float
    reason: str = ""


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """State of the physics that decides about success.

    Attributes:
        model: Compiled model.
        data: State of the model.
        tool: Pose of the tool in torso axes.
        grip: Commanded grip, 0 to 1.
        forces: Largest forces since the start [N]: "tool" and each fragile geom.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    tool: Pose
    grip: float
    forces: Mapping[str, float]
