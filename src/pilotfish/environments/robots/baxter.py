"""Baxter: the right arm holds the tool, and a person guides the left arm."""

from functools import partial

import mujoco
import numpy as np

from pilotfish.environments.baxter.body import add_arm, add_torso, joint_names
from pilotfish.environments.baxter.chain import (
    LEFT,
    NOMINAL_POSTURE,
    RIGHT,
    arm_chain,
    baxter_limits,
    mirror_posture,
)
from pilotfish.environments.baxter.parameters import JOINT_NAMES
from pilotfish.environments.robots.robot import LeaderArm, Robot

# Position control, N m/rad and N m s/rad: about 4 Hz, well damped.
POSITION_STIFFNESS = np.array([400.0, 400.0, 200.0, 200.0, 60.0, 60.0, 40.0])
POSITION_DAMPING = np.array([40.0, 40.0, 20.0, 20.0, 4.0, 4.0, 2.0])
IDLE_POSTURE = (-0.6, -0.9, -0.9, 2.1, 0.6, 0.6, 0.0)  # rad, of an unused left arm: out of the way


def _add_idle_arm(spec: mujoco.MjSpec) -> None:
    add_arm(spec, LEFT, posture=IDLE_POSTURE)


BAXTER = Robot(
    name="baxter",
    joint_names=JOINT_NAMES,
    chain=arm_chain(RIGHT),
    limits=baxter_limits(),
    posture=NOMINAL_POSTURE,
    add_body=add_torso,
    add_arm=partial(add_arm, side=RIGHT),
    position_stiffness=POSITION_STIFFNESS,
    position_damping=POSITION_DAMPING,
    leader=LeaderArm(joint_names(LEFT), partial(add_arm, side=LEFT), _add_idle_arm, mirror_posture),
)
