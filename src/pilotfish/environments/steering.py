"""How an arm is told where to go: straight paths between targets, and another arm that leads it."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control import ToolTarget
from pilotfish.geometry import Pose, conjugate, exp, log, multiply
from pilotfish.types import Array, Float

# How a person holds the knob of the arm that they lead: firmly, not stiffly.
HAND_STIFFNESS = np.array([900.0, 900.0, 900.0, 25.0, 25.0, 25.0])  # N/m, N m/rad
HAND_DAMPING = np.array([50.0, 50.0, 50.0, 1.5, 1.5, 1.5])  # N s/m, N m s/rad


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """From one pose to another at an even pace: a target for each tick, the first a tick after the start."""

    positions: Float[Array, "n 3"]
    quaternions: Float[Array, "n 4"]
    twist: Float[Array, " 6"]

    def at(self, n: int) -> ToolTarget:
        return ToolTarget(self.positions[n], self.quaternions[n], self.twist)


def straight(a: Pose, b: Pose, ticks: int, tick: float) -> Path:
    """The straight way from a to b in so many ticks [s], turning the shorter way about one axis."""
    shares = np.arange(1, ticks + 1)[:, None] / ticks
    turn = turn_between(a.quaternion, b.quaternion)
    move = b.position - a.position
    quaternions = multiply(exp(0.5 * shares * turn), a.quaternion)
    return Path(a.position + shares * move, quaternions, np.append(move, turn) / (ticks * tick))


def turn_between(q: Float[Array, " 4"], p: Float[Array, " 4"]) -> Float[Array, " 3"]:
    """The rotation vector [rad], in world axes, that takes q to p the shorter way."""
    between = multiply(p, conjugate(q))
    return 2.0 * log(between if between[0] >= 0.0 else -between)


@dataclass(frozen=True, slots=True, eq=False)
class Clutch:
    """Two tools that move alike, from where each was when they were joined."""

    leader: Pose
    follower: Pose

    def follow(self, leader: Pose) -> Pose:
        """Where the follower is to be, the leader being there."""
        return _moved_alike(self.leader, leader, self.follower)

    def lead(self, follower: Pose) -> Pose:
        """Where the leader has to be for the follower to be there."""
        return _moved_alike(self.follower, follower, self.leader)


def _moved_alike(begun: Pose, now: Pose, other: Pose) -> Pose:
    turn = multiply(now.quaternion, conjugate(begun.quaternion))
    return Pose(other.position + now.position - begun.position, multiply(turn, other.quaternion))


def hand_wrench(hand: Pose, tool: Pose, twist: Float[Array, " 6"]) -> Float[Array, " 6"]:
    """Force [N] and moment [N m] with which a person's hand pulls the knob that it holds."""
    away = np.append(hand.position - tool.position, turn_between(tool.quaternion, hand.quaternion))
    return np.asarray(HAND_STIFFNESS * away - HAND_DAMPING * twist)
