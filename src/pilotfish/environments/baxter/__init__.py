"""Baxter, the two-armed robot of the thesis: the facts of its joints and masses, its arms as chains, its
body as MuJoCo simulates it in shapes of our own, and the tools that it is fitted with.
"""

from pilotfish.environments.baxter.body import FLOOR, ROBOT, THING, add_arm, arm_names, empty_world
from pilotfish.environments.baxter.chain import arm_chain, baxter_limits, mirrored, posture_for
from pilotfish.environments.baxter.dress import Surface, dress
from pilotfish.environments.baxter.facts import JOINTS, Joint
from pilotfish.environments.baxter.tools import (
    Tool,
    held_body,
    mount_gripper,
    mount_handle,
    mount_point,
    mount_suction,
    part,
)

__all__ = [
    "FLOOR",
    "JOINTS",
    "ROBOT",
    "THING",
    "Joint",
    "Surface",
    "Tool",
    "add_arm",
    "arm_chain",
    "arm_names",
    "baxter_limits",
    "dress",
    "empty_world",
    "held_body",
    "mirrored",
    "mount_gripper",
    "mount_handle",
    "mount_point",
    "mount_suction",
    "part",
    "posture_for",
]
