"""Straight tool paths, relative motion between two arms, and the force of a hand that guides an arm."""

import numpy as np

from pilotfish.geometry import Pose, conjugate, from_rotation_vector, multiply, rotation_vector_in_world
from pilotfish.kernels import ToolTarget
from pilotfish.types import Array, Float

# A person holds the handle of the guided arm firmly, not stiffly.
HAND_STIFFNESS = np.array([900.0, 900.0, 900.0, 25.0, 25.0, 25.0])  # N/m, N m/rad
HAND_DAMPING = np.array([50.0, 50.0, 50.0, 1.5, 1.5, 1.5])  # N s/m, N m s/rad


def linear_path(start: Pose, end: Pose, n_steps: int, timestep: float) -> list[ToolTarget]:
    """Return the targets of a straight path at constant speed, the first one timestep after the start.

    The rotation takes the shorter way about one axis.

    Args:
        start: Pose at time 0; it is not a target.
        end: Pose of the last target.
        n_steps: Number of targets, at least 1.
        timestep: Time between targets [s].
    """
    shares = np.arange(1, n_steps + 1)[:, None] / n_steps
    rotation = rotation_vector_in_world(start.quaternion, end.quaternion)
    translation = end.position - start.position
    quaternions = multiply(from_rotation_vector(shares * rotation), start.quaternion)
    positions = start.position + shares * translation
    twist = np.append(translation, rotation) / (n_steps * timestep)
    return [ToolTarget(p, q, twist) for p, q in zip(positions, quaternions, strict=True)]


def follow_relative_motion(leader_start: Pose, leader: Pose, follower_start: Pose) -> Pose:
    """Return the follower's pose after it made the same motion as the leader, in world axes.

    Args:
        leader_start: Pose of the leader when the two were coupled.
        leader: Pose of the leader now.
        follower_start: Pose of the follower when the two were coupled.
    """
    rotation = multiply(leader.quaternion, conjugate(leader_start.quaternion))
    return Pose(
        follower_start.position + leader.position - leader_start.position,
        multiply(rotation, follower_start.quaternion),
    )


def guidance_wrench(hand: Pose, tool: Pose, twist: Float[Array, " 6"]) -> Float[Array, " 6"]:
    """Return force [N] and moment [N m] of a hand on the handle that it holds, in world axes.

    The hand is a spring between its own pose and the tool, with a damper.

    Args:
        hand: Pose of the hand.
        tool: Pose of the handle.
        twist: Velocity of the handle [m/s, rad/s].
    """
    offset = np.append(
        hand.position - tool.position, rotation_vector_in_world(tool.quaternion, hand.quaternion)
    )
    return np.asarray(HAND_STIFFNESS * offset - HAND_DAMPING * twist)
