"""Robots by name."""

from pilotfish.environments.robots.baxter import BAXTER
from pilotfish.environments.robots.panda import PANDA
from pilotfish.environments.robots.robot import Robot
from pilotfish.environments.robots.ur5e import UR5E

ROBOTS: dict[str, Robot] = {robot.name: robot for robot in (BAXTER, PANDA, UR5E)}
