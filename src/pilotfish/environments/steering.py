"""How an arm is told where to go: straight paths between targets, and another arm that leads it."""

from dataclasses import dataclass

import numpy as np

from pilotfish.geometry import (
    Pose,
    conjugate,
    from_rotation_vector,
    multiply,
    rotation_vector_in_world,
)
from pilotfish.kernels import ToolTarget
from pilotfish.types import Array, Float

# How a person holds the knob of the arm that they lead: firmly, not stiffly.
HAND_STIFFNESS = np.array([900.0, 900.0, 900.0, 25.0, 25.0, 25.0])  # N/m, N m/rad
HAND_DAMPING = np.array([50.0, 50.0, 50.0, 1.5, 1.5, 1.5])  # N s/m, N m s/rad


@dataclass(frozen=True, slots=True, eq=False)
class LinearPath:
    """From one pose to another at an even pace: a target for each tick, the first a tick after the start."""

    positions: Float[Array, "n 3"]
    quaternions: Float[Array, "n 4"]
    twist: Float[Array, " 6"]

    def at(self, n: int) -> ToolTarget:
        return ToolTarget(self.positions[n], self.quaternions[n], self.twist)


def linear_path(a: Pose, b: Pose, n_steps: int, timestep: float) -> LinearPath:
    """The straight way from a to b in so many ticks [s], turning the shorter way about one axis."""
    shares = np.arange(1, n_steps + 1)[:, None] / n_steps
    turn = rotation_vector_in_world(a.quaternion, b.quaternion)
    move = b.position - a.position
    quaternions = multiply(from_rotation_vector(shares * turn), a.quaternion)
    return LinearPath(a.position + shares * move, quaternions, np.append(move, turn) / (n_steps * timestep))


@dataclass(frozen=True, slots=True, eq=False)
class RelativeMapping:
    """Two tools that move alike, from where each was when they were joined."""

    leader: Pose
    follower: Pose

    def follower_pose(self, leader: Pose) -> Pose:
        """Where the follower is to be, the leader being there."""
        return _apply_relative_motion(self.leader, leader, self.follower)

    def leader_pose(self, follower: Pose) -> Pose:
        """Where the leader has to be for the follower to be there."""
        return _apply_relative_motion(self.follower, follower, self.leader)


def _apply_relative_motion(start: Pose, now: Pose, other: Pose) -> Pose:
    turn = multiply(now.quaternion, conjugate(start.quaternion))
    return Pose(other.position + now.position - start.position, multiply(turn, other.quaternion))


def guidance_wrench(hand: Pose, tool: Pose, twist: Float[Array, " 6"]) -> Float[Array, " 6"]:
    """Force [N] and moment [N m] with which a person's hand pulls the knob that it holds."""
    away = np.append(
        hand.position - tool.position, rotation_vector_in_world(tool.quaternion, hand.quaternion)
    )
    return np.asarray(HAND_STIFFNESS * away - HAND_DAMPING * twist)
