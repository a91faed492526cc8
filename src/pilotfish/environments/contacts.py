"""How hard things touch."""

from collections.abc import Mapping

import mujoco
import numpy as np

from pilotfish.environments.baxter import ROBOT
from pilotfish.types import Array, Float

TOOL_FORCE = "tool"  # the sum of what pushes the robot, beside the names of fragile things


def contact_forces(
    model: mujoco.MjModel, data: mujoco.MjData, contact_limits: tuple[str, ...]
) -> dict[str, float]:
    """The force [N] of all contacts of the robot together, under "tool", and on each fragile shape.

    On a fragile shape the sizes of its contacts' forces are added: pressing it from both sides counts twice.
    """
    total, on = np.zeros(3), dict.fromkeys(contact_limits, 0.0)
    named = {int(model.geom(name).id): name for name in contact_limits}
    for n, pair in enumerate(data.contact.geom.tolist()):
        robot = [model.geom_contype[geom] == ROBOT for geom in pair]
        touched = [named[geom] for geom in pair if geom in named]
        if not (any(robot) or touched):
            continue
        force = _force(model, data, n)
        if any(robot):
            total += force if robot[1] else -force
        for name in touched:
            on[name] += float(np.linalg.norm(force))
    return {TOOL_FORCE: float(np.linalg.norm(total)), **on}


def elementwise_max(a: Mapping[str, float], b: Mapping[str, float]) -> dict[str, float]:
    """Of two measurements of the same things, the larger of each."""
    return {name: max(value, b[name]) for name, value in a.items()}


def _force(model: mujoco.MjModel, data: mujoco.MjData, n: int) -> Float[Array, " 3"]:
    """What the n-th contact's second shape is pushed by, in world axes."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(model, data, n, wrench)
    return np.asarray(data.contact[n].frame.reshape(3, 3).T @ wrench[:3])
