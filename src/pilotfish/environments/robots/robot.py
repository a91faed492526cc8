"""What a robot is: its arm in the model, its kinematics and limits, and how it is controlled."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from pilotfish.control import SerialChain, impedance, inverse_kinematics
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.kernels import ArmLimits, ImpedanceParameters
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type, shorten_repr

REACH_TOLERANCE = 1e-3  # m, rad: largest error of a posture
RESTARTS, RESTART_ITERATIONS = 16, 80  # starts of the search besides the nominal posture, and their steps
MAX_TOOL_LENGTH = 3.0  # m
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
SIDE = "right"  # prefix of the joints of the arm that holds the tool


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LeaderArm:
    """Second arm of a robot, by which a person guides the first one.

    Attributes:
        joints: Names of its joints in the model, in order.
        add_arm: Function that adds it to a model and returns its hand.
        add_idle_arm: Function that adds it to a model as a rigid arm that is out of the way.
        mirror: Function from a posture of the first arm to that of the leader arm.
    """

    joints: tuple[str, ...]
    add_arm: Callable[[mujoco.MjSpec], mujoco.MjsBody]
    add_idle_arm: Callable[[mujoco.MjSpec], None]
    mirror: Callable[[Float[Array, " n"]], Float[Array, " n"]]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """Arm of n joints at its place in the workcell; poses are in torso axes, which are the world axes.

    Attributes:
        name: Name on the command line, or the model's name in a file.
        joint_names: Names of the joints, in order.
        chain: Kinematics from the world to the hand, on which tools are mounted; tools point along its z.
        limits: Limits of the joints.
        posture: Joint positions from which a posture is searched, and which are preferred [rad].
        add_body: Function that adds what stands still, such as a pedestal.
        add_arm: Function that adds the arm and returns its hand; joints are named "right_" + joint name.
        position_stiffness: Stiffness of each joint under position control [N m/rad].
        position_damping: Damping of each joint under position control [N m s/rad].
        impedance: Function from a posture to the parameters of impedance control.
        leader: Arm by which a person guides the robot; None if the hand drives the target itself.
    """

    name: str
    joint_names: tuple[str, ...]
    chain: SerialChain
    limits: ArmLimits
    posture: Float[Array, " n"]
    add_body: Callable[[mujoco.MjSpec], None]
    add_arm: Callable[[mujoco.MjSpec], mujoco.MjsBody]
    position_stiffness: Float[Array, " n"]
    position_damping: Float[Array, " n"]
    impedance: Callable[[Float[Array, " n"]], ImpedanceParameters] = impedance
    leader: LeaderArm | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """Return the names of the arm's joints in a model, which are also those of its motors."""
        return tuple(f"{SIDE}_{name}" for name in self.joint_names)


def chain_with_tool(robot: Robot, tool_length: float = 0.0) -> SerialChain:
    """Return the kinematics of a robot to a tool point.

    Args:
        robot: Robot, such as `ROBOTS["panda"]`.
        tool_length: Distance of the tool point from the hand along its z axis [m].

    Raises:
        InvalidInput: If an argument cannot be used.
    """
    require_type(robot, "robot", Robot, "take one from ROBOTS")
    length = require_number(tool_length, "tool_length", 0.0, MAX_TOOL_LENGTH)
    hand_from_tool = Pose(np.array([0.0, 0.0, length]), IDENTITY)
    return replace(robot.chain, last_from_tool=robot.chain.last_from_tool @ hand_from_tool)


def solve_posture(robot: Robot, tool: Pose, tool_length: float = 0.0) -> Float[Array, " n"]:
    """Return joint positions that bring the tool of a robot to a pose, near its nominal posture [rad].

    If the search from the nominal posture fails, it is repeated from 16 postures between the limits, always
    the same ones. Of the postures found, the one nearest to the nominal posture is returned.

    Args:
        robot: Robot, such as `ROBOTS["panda"]`.
        tool: Pose of the tool point in torso axes.
        tool_length: Distance of the tool point from the hand [m].

    Raises:
        InvalidInput: If the arm does not reach the pose to 1 mm and 1 mrad.
    """
    chain = chain_with_tool(robot, tool_length)
    require_type(tool, "tool", Pose, "geometry.pose(position, quaternion) creates one")
    nominal, limits = robot.posture, robot.limits
    first = inverse_kinematics(chain, tool, nominal, limits, posture=nominal)
    if max(first[1], first[2]) <= REACH_TOLERANCE:
        return first[0]
    starts = np.random.default_rng(0).uniform(limits.lower, limits.upper, (RESTARTS, len(nominal)))
    found = [
        inverse_kinematics(
            chain,
            tool,
            0.5 * (nominal + q),
            limits,
            posture=nominal,
            max_iterations=RESTART_ITERATIONS,
        )
        for q in starts
    ]
    if reached := [q for q, distance, angle, _ in found if max(distance, angle) <= REACH_TOLERANCE]:
        return min(reached, key=lambda q: float(np.linalg.norm(q - nominal)))
    _, distance, angle, _ = min([first, *found], key=lambda solution: solution[1] + solution[2])
    raise InvalidInput(
        f"the arm of {robot.name} does not reach position {np.round(tool.position, 3).tolist()} m, "
        f"quaternion {np.round(tool.quaternion, 3).tolist()}; the nearest posture is {distance:.3g} m "
        f"and {angle:.3g} rad away; choose a pose nearer to the robot"
    )
