"""Contact forces on the robot and on objects that must not be pushed."""

import mujoco
import numpy as np

from pilotfish.environments.world import ROBOT

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
    names = {mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name): name for name in fragile_geoms}
    if -1 in names:
        model.geom(names[-1])  # raises a KeyError that lists the geoms
    geoms, axes = data.contact.geom, data.contact.frame.reshape(-1, 3, 3)
    robot = (model.geom_contype[geoms] == ROBOT).tolist()
    wrench = np.zeros(6)
    for n, pair in enumerate(geoms.tolist()):
        touched = [names[geom] for geom in pair if geom in names]
        if not (any(robot[n]) or touched):
            continue
        mujoco.mj_contactForce(model, data, n, wrench)
        force = axes[n].T @ wrench[:3]  # on the second geom, in world axes
        if any(robot[n]):
            total += force if robot[n][1] else -force
        for name in touched:
            on_geom[name] += float(np.linalg.norm(force))
    return {TOOL_FORCE: float(np.linalg.norm(total)), **on_geom}
