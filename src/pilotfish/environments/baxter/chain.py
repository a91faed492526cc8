"""Baxter's arms as chains of joints, without physics: where a tool is, and joints that bring it to a pose."""

import numpy as np

from pilotfish.control import SerialChain, arm_limits, inverse_kinematics
from pilotfish.environments.baxter.facts import HAND_FROM_WRIST, JOINTS, MOUNT, MOUNT_YAW, Triple
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector, multiply
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Float

RIGHT, LEFT = "right", "left"
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # what the other arm's joints do in a mirror
REACH_TOLERANCE = 1e-3  # m, rad: what a home may be missed by
# Elbow out and down, hand ahead: where searches for a posture begin, of the right arm [rad].
NOMINAL_POSTURE = np.array([0.3, -0.6, 0.9, 1.6, -0.6, 0.8, 0.3])


def arm_chain(side: str, tool_length: float = 0.0) -> SerialChain:
    """The arm on a side, "left" or "right", in the axes of the torso, and a tool so far [m] from its hand.

    Raises: InvalidInput, for another side.
    """
    if side not in (LEFT, RIGHT):
        raise InvalidInput(f"side is {side!r}, expected {LEFT!r} or {RIGHT!r}")
    sign = 1.0 if side == LEFT else -1.0
    x, y, z = MOUNT
    base = Pose(np.array([x, sign * y, z]), quaternion_from_rpy((0.0, 0.0, sign * MOUNT_YAW)))
    tool = Pose(np.array([0.0, 0.0, HAND_FROM_WRIST + tool_length]), quaternion_from_rpy((0.0, 0.0, 0.0)))
    return SerialChain(
        base,
        np.array([joint.xyz for joint in JOINTS]),
        np.stack([quaternion_from_rpy(joint.rpy) for joint in JOINTS]),
        np.tile([0.0, 0.0, 1.0], (len(JOINTS), 1)),
        tool,
    )


def baxter_limits() -> ArmLimits:
    """What the joints of either arm can do."""
    return arm_limits(*zip(*((j.lower, j.upper, j.velocity, j.torque) for j in JOINTS), strict=True))


def solve_posture(tool: Pose, tool_length: float, side: str = RIGHT) -> Float[Array, " 7"]:
    """Joints [rad] that bring the tool to a pose, the nearest found to an easy posture.

    Raises: InvalidInput, when the arm does not reach it.
    """
    start = NOMINAL_POSTURE if side == RIGHT else MIRROR * NOMINAL_POSTURE
    reach = inverse_kinematics(arm_chain(side, tool_length), tool, start, baxter_limits(), posture=start)
    if reach.position_error > REACH_TOLERANCE or reach.angle_error > REACH_TOLERANCE:
        raise InvalidInput(
            f"the {side} arm does not reach {np.round(tool.position, 3).tolist()} m, quaternion "
            f"{np.round(tool.quaternion, 3).tolist()}: it stays {reach.position_error:.3g} m and "
            f"{reach.angle_error:.3g} rad away; choose a place nearer to the robot"
        )
    return reach.q


def mirror_posture(q: Float[Array, " 7"]) -> Float[Array, " 7"]:
    """The posture of the other arm, as a mirror between the arms shows it."""
    return np.asarray(MIRROR * q)


def quaternion_from_rpy(rpy: Triple) -> Float[Array, " 4"]:
    """Roll, pitch and yaw [rad] about axes that stand, in this order, as w x y z."""
    roll, pitch, yaw = (
        from_rotation_vector(angle * axis) for angle, axis in zip(rpy, np.eye(3), strict=True)
    )
    return multiply(yaw, multiply(pitch, roll))
