"""What the arm controller is given and gives back: n joints, at most 16, the tool in world axes."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class ArmLimits:
    """How far [rad], how fast [rad/s] and how hard [N m] each joint goes; the last two either way."""

    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    velocity: Float[Array, " n"]
    torque: Float[Array, " n"]


@dataclass(frozen=True, slots=True, eq=False)
class ImpedanceParameters:
    """Springs and dampers that hold a tool, along and about the world's axes, and its arm in shape.

    force_limit       of springs and of springs with dampers: longer forces are shortened [N]
    moment_limit      likewise of moments [N m]
    singular_value    directions of the Jacobian below it count less as task, more as null space
    limit_margin      how near a joint's limits a spring pushes it back [rad], of limit_stiffness [N m/rad]
    """

    stiffness: Float[Array, " 6"]  # N/m along x y z, N m/rad about them
    damping: Float[Array, " 6"]  # N s/m, N m s/rad
    posture: Float[Array, " n"]  # rad, q_neutral
    posture_stiffness: float  # N m/rad, in the null space: k_q
    joint_damping: float  # N m s/rad: k_v
    force_limit: float
    moment_limit: float
    min_singular_value: float
    limit_margin: float
    limit_stiffness: float


@dataclass(frozen=True, slots=True, eq=False)
class ArmState:
    """An arm now: joints, its tool in the world, and what both have to do with each other."""

    q: Float[Array, " n"]  # rad
    velocity: Float[Array, " n"]  # rad/s
    position: Float[Array, " 3"]  # m
    quaternion: Float[Array, " 4"]
    jacobian: Float[Array, "6 n"]  # velocity to twist of the tool's point: m/s, then rad/s
    bias: Float[Array, " n"]  # gravity and Coriolis [N m]: what holds the arm as it moves


@dataclass(frozen=True, slots=True, eq=False)
class ToolTarget:
    """Where a tool is wanted, and how it is to move there: m/s, then rad/s, world axes."""

    position: Float[Array, " 3"]
    quaternion: Float[Array, " 4"]
    twist: Float[Array, " 6"]


@dataclass(frozen=True, slots=True, eq=False)
class ArmCommand:
    """Torques [N m] within their limits, and how they came about.

    wrench is what spring and damper ask for, within its own limits [N, N m]; share, 0 to 1, is the least part
    that a joint could give of what was asked of it beyond the bias: 1 when no limit on torque was met.
    """

    torque: Float[Array, " n"]
    wrench: Float[Array, " 6"]
    torque_fraction: float


def clip_torque(
    limit: Float[Array, " n"], bias: Float[Array, " n"], joint_torque: Float[Array, " n"]
) -> tuple[Float[Array, " n"], float]:
    """Bias + push, each cut to its limit, and the least share of its push that any joint could give.

    Every joint for itself: one that hardly carries its own weight must not stop the others.
    """
    torque, clipped_bias = np.clip(bias + joint_torque, -limit, limit), np.clip(bias, -limit, limit)
    saturated = torque != bias + joint_torque
    shares = (torque[saturated] - clipped_bias[saturated]) / np.where(
        joint_torque[saturated] == 0.0, np.inf, joint_torque[saturated]
    )
    return torque, float(shares.min(initial=1.0))


def zero_non_finite(values: Float[Array, " n"]) -> Float[Array, " n"]:
    """The same, but zero where it is no finite number: what is not known pushes nothing."""
    return np.where(np.isfinite(values), values, 0.0)
