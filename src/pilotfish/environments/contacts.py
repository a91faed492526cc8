"""Contact forces on the robot and on objects that must not be pushed."""

import mujoco
import numpy as np

from pilotfish.environments.baxter.body import ROBOT
from pilotfish.types import Array, Float

TOOL_FORCE = "tool"  # key of the total force on the robot, beside the names of the fragile geoms


def contact_forces(
    model: mujoco.MjModel, data: mujoco.MjData, fragile_geoms: tuple[str, ...]
) -> dict[str, float]:
    """Return the total contact force on the robot under "tool", and the force on each fragile geom [N].

    For a fragile geom the magnitudes of its contact forces are added: squeezing it from two sides counts
    twice.

    Args:
        model: Compiled model.
        data: State whose contacts have forces.
        fragile_geoms: Names of the geoms to measure.
    """
    total, on_geom = np.zeros(3), dict.fromkeys(fragile_geoms, 0.0)
    names = {int(model.geom(name).id): name for name in fragile_geoms}
    for n, pair in enumerate(data.contact.geom.tolist()):
        robot = [model.geom_contype[geom] == ROBOT for geom in pair]
        touched = [names[geom] for geom in pair if geom in names]
        if not (any(robot) or touched):
            continue
        force = _force_on_second_geom(model, data, n)
        if any(robot):
            total += force if robot[1] else -force
        for name in touched:
            on_geom[name] += float(np.linalg.norm(force))
    return {TOOL_FORCE: float(np.linalg.norm(total)), **on_geom}


def _force_on_second_geom(model: mujoco.MjModel, data: mujoco.MjData, n: int) -> Float[Array, " 3"]:
    """Return the force of contact n in world axes [N]."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(model, data, n, wrench)
    return np.asarray(data.contact[n].frame.reshape(3, 3).T @ wrench[:3])
