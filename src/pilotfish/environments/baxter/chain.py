"""Kinematics of Baxter's arms: serial chains, joint limits and inverse kinematics."""

import numpy as np

from pilotfish.control import SerialChain, arm_limits, inverse_kinematics
from pilotfish.environments.baxter.parameters import (
    HAND_FROM_WRIST,
    JOINT_ORIGINS,
    JOINT_ROTATIONS,
    LOWER_LIMITS,
    MAX_TORQUES,
    MAX_VELOCITIES,
    MOUNT,
    MOUNT_YAW,
    UPPER_LIMITS,
    Triple,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector, multiply
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Float

RIGHT, LEFT = "right", "left"
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # signs of the joints of the mirrored arm
REACH_TOLERANCE = 1e-3  # m, rad: largest error of a posture
# Initial posture of the search [rad], for the right arm: elbow out and down, hand ahead.
NOMINAL_POSTURE = np.array([0.3, -0.6, 0.9, 1.6, -0.6, 0.8, 0.3])


def arm_chain(side: str, tool_length: float = 0.0) -> SerialChain:
    """Return the kinematic chain of an arm in torso axes.

    Args:
        side: "left" or "right".
        tool_length: Distance of the tool point from the hand along its z axis [m].

    Raises:
        InvalidInput: If the side is another.
    """
    if side not in (LEFT, RIGHT):
        raise InvalidInput(f"side is {side!r}, expected {LEFT!r} or {RIGHT!r}")
    sign = 1.0 if side == LEFT else -1.0
    x, y, z = MOUNT
    base = Pose(np.array([x, sign * y, z]), quaternion_from_rpy((0.0, 0.0, sign * MOUNT_YAW)))
    tool = Pose(np.array([0.0, 0.0, HAND_FROM_WRIST + tool_length]), quaternion_from_rpy((0.0, 0.0, 0.0)))
    return SerialChain(
        base,
        np.array(JOINT_ORIGINS),
        np.stack([quaternion_from_rpy(rpy) for rpy in JOINT_ROTATIONS]),
        np.tile([0.0, 0.0, 1.0], (len(JOINT_ORIGINS), 1)),
        tool,
    )


def baxter_limits() -> ArmLimits:
    """Return the joint limits, which are the same for both arms."""
    return arm_limits(LOWER_LIMITS, UPPER_LIMITS, MAX_VELOCITIES, MAX_TORQUES)


def solve_posture(tool: Pose, tool_length: float, side: str = RIGHT) -> Float[Array, " 7"]:
    """Return joint positions that bring the tool to a pose, near a nominal posture [rad].

    Args:
        tool: Pose of the tool point in torso axes.
        tool_length: Distance of the tool point from the hand [m].
        side: "left" or "right".

    Raises:
        InvalidInput: If the arm does not reach the pose to 1 mm and 1 mrad.
    """
    start = NOMINAL_POSTURE if side == RIGHT else MIRROR * NOMINAL_POSTURE
    q, distance, angle, _ = inverse_kinematics(
        arm_chain(side, tool_length), tool, start, baxter_limits(), posture=start
    )
    if distance > REACH_TOLERANCE or angle > REACH_TOLERANCE:
        raise InvalidInput(
            f"the {side} arm does not reach position {np.round(tool.position, 3).tolist()} m, quaternion "
            f"{np.round(tool.quaternion, 3).tolist()}; the nearest posture is {distance:.3g} m "
            f"and {angle:.3g} rad away; choose a pose nearer to the robot"
        )
    return q


def mirror_posture(q: Float[Array, " 7"]) -> Float[Array, " 7"]:
    """Return the mirrored posture for the other arm [rad]."""
    return np.asarray(MIRROR * q)


def quaternion_from_rpy(rpy: Triple) -> Float[Array, " 4"]:
    """Return the quaternion of roll, pitch and yaw about fixed axes, in this order [rad]."""
    roll, pitch, yaw = (
        from_rotation_vector(angle * axis) for angle, axis in zip(rpy, np.eye(3), strict=True)
    )
    return multiply(yaw, multiply(pitch, roll))
