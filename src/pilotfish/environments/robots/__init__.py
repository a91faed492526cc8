"""Robots that perform the tasks: Baxter, the Panda of Franka Emika, the UR5e, and arms from files."""

from pilotfish.environments.robots.description import robot_from_description
from pilotfish.environments.robots.joint_trajectory import JointTrajectory, joint_trajectory
from pilotfish.environments.robots.registry import ROBOTS
from pilotfish.environments.robots.robot import LeaderArm, Robot, chain_with_tool, solve_posture

__all__ = [
    "ROBOTS",
    "JointTrajectory",
    "LeaderArm",
    "Robot",
    "chain_with_tool",
    "joint_trajectory",
    "robot_from_description",
    "solve_posture",
]
