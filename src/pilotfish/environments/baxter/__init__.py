"""Baxter, the two-armed robot of the thesis: the facts of its joints and masses, its arms as chains, its
body as MuJoCo simulates it in shapes of our own, and the tools that it is fitted with.
"""

from pilotfish.environments.baxter.body import FLOOR, OBJECT, ROBOT, add_arm, arm_names, empty_world
from pilotfish.environments.baxter.chain import arm_chain, baxter_limits, mirror_posture, solve_posture
from pilotfish.environments.baxter.dress import VisualMesh, add_visual_meshes
from pilotfish.environments.baxter.facts import JOINTS, Joint
from pilotfish.environments.baxter.tools import (
    Tool,
    add_tool_body,
    add_tool_geom,
    add_tool_point,
    mount_gripper,
    mount_handle,
    mount_suction,
)

__all__ = [
    "FLOOR",
    "JOINTS",
    "OBJECT",
    "ROBOT",
    "Joint",
    "Tool",
    "VisualMesh",
    "add_arm",
    "add_tool_body",
    "add_tool_geom",
    "add_tool_point",
    "add_visual_meshes",
    "arm_chain",
    "arm_names",
    "baxter_limits",
    "empty_world",
    "mirror_posture",
    "mount_gripper",
    "mount_handle",
    "mount_suction",
    "solve_posture",
]
