"""Arguments and results of the arm controller, for n joints (at most 16) and a tool in world axes."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ArmLimits:
    """Limits of the joints.

    Attributes:
        lower: Lowest positions [rad].
        upper: Highest positions [rad].
        velocity: Largest speeds, in both directions [rad/s].
        torque: Largest torques, in both directions [N m].
    """

    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    velocity: Float[Array, " n"]
    torque: Float[Array, " n"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ImpedanceParameters:
    """Cartesian impedance of the tool in world axes, and joint impedance in its null space.

    Attributes:
        stiffness: Translational stiffness [N/m], then rotational stiffness [N m/rad].
        damping: Translational damping [N s/m], then rotational damping [N m s/rad].
        posture: Preferred joint positions q_neutral [rad].
        posture_stiffness: Stiffness towards the posture in the null space, k_q [N m/rad].
        joint_damping: Damping of every joint, k_v [N m s/rad].
        force_limit: Largest force of the spring, and of spring and damper together [N].
        moment_limit: Largest moment of the spring, and of spring and damper together [N m].
        min_singular_value: Directions of the Jacobian with smaller singular values fade into the null space.
        limit_margin: Distance to a joint limit at which a spring begins to push back [rad].
        limit_stiffness: Stiffness of that spring [N m/rad].
    """

    stiffness: Float[Array, " 6"]
    damping: Float[Array, " 6"]
    posture: Float[Array, " n"]
    posture_stiffness: float
    joint_damping: float
    force_limit: float
    moment_limit: float
    min_singular_value: float
    limit_margin: float
    limit_stiffness: float


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ArmState:
    """Measured state of an arm.

    Attributes:
        q: Joint positions [rad].
        velocity: Joint velocities [rad/s].
        position: Tool position in the world [m].
        quaternion: Tool orientation, w x y z.
        jacobian: Maps joint velocities to the twist of the tool, in world axes: [m/s], then [rad/s].
        bias: Gravity and Coriolis torques [N m], which compensate the motion of the arm.
    """

    q: Float[Array, " n"]
    velocity: Float[Array, " n"]
    position: Float[Array, " 3"]
    quaternion: Float[Array, " 4"]
    jacobian: Float[Array, "6 n"]
    bias: Float[Array, " n"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ToolTarget:
    """Desired pose and twist of a tool, in world axes.

    Attributes:
        position: Desired position [m].
        quaternion: Desired orientation, w x y z.
        twist: Desired velocity [m/s], then angular velocity [rad/s].
    """

    position: Float[Array, " 3"]
    quaternion: Float[Array, " 4"]
    twist: Float[Array, " 6"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ArmCommand:
    """Joint torques within their limits.

    Attributes:
        torque: Joint torques [N m].
        wrench: Force and moment of spring and damper, within their limits [N, N m].
        torque_fraction: Smallest fraction of its requested torque beyond the bias that a joint could apply,
            from 0 to 1; 1 if no torque limit was active.
    """

    torque: Float[Array, " n"]
    wrench: Float[Array, " 6"]
    torque_fraction: float


def clip_torque(
    limit: Float[Array, " n"], bias: Float[Array, " n"], joint_torque: Float[Array, " n"]
) -> tuple[Float[Array, " n"], float]:
    """Return bias + joint_torque clipped to the limits, and the smallest fraction of joint_torque applied.

    Every joint is clipped on its own: a joint that can hardly carry its weight must not stop the others.

    Args:
        limit: Largest torques, in both directions [N m].
        bias: Gravity and Coriolis torques [N m].
        joint_torque: Requested torques beyond the bias [N m].
    """
    torque, clipped_bias = np.clip(bias + joint_torque, -limit, limit), np.clip(bias, -limit, limit)
    saturated = torque != bias + joint_torque
    fractions = (torque[saturated] - clipped_bias[saturated]) / np.where(
        joint_torque[saturated] == 0.0, np.inf, joint_torque[saturated]
    )
    return torque, float(fractions.min(initial=1.0))


def zero_non_finite(values: Float[Array, " n"]) -> Float[Array, " n"]:
    """Return the values, with zero in place of NaN and infinities.

    Args:
        values: Torques [N m].
    """
    return np.where(np.isfinite(values), values, 0.0)
