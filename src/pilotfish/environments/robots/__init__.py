"""Robots that perform the tasks: Baxter, Franka Emika's Panda, Universal Robots' UR5e, and arms from files."""

from pilotfish.environments.robots.registry import ROBOTS
from pilotfish.environments.robots.robot import LeaderArm, Robot, chain_with_tool, solve_posture

__all__ = ["ROBOTS", "LeaderArm", "Robot", "chain_with_tool", "solve_posture"]
