"""Robots that perform the tasks: Baxter, the Panda of Franka Emika, the UR5e, and arms from files."""

from pilotfish.environments.robots.description import robot_from_description
from pilotfish.environments.robots.registry import ROBOTS
from pilotfish.environments.robots.robot import LeaderArm, Robot, chain_with_tool, solve_posture

__all__ = ["ROBOTS", "LeaderArm", "Robot", "chain_with_tool", "robot_from_description", "solve_posture"]
