"""Cartesian impedance control of an arm, with a posture in the null space."""

import numpy as np

from pilotfish.kernels.arm_types import (
    ArmCommand,
    ArmLimits,
    ArmState,
    ImpedanceParameters,
    ToolTarget,
    clip_torque,
    zero_non_finite,
)
from pilotfish.types import Array, Float


def impedance_torque(
    parameters: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> ArmCommand:
    """Return the torque of Cartesian springs and dampers, a posture and joint limit springs.

    torque = bias + J^T F + N k_q (q_neutral - q) - k_v dq/dt + joint limit springs, clipped to the limits.

    F = K e - D (J dq/dt - twist), where e is the position and rotation error to the target. K e and F are
    each scaled down to the limits on force and moment. N = I - J^T J^+T is the null-space projector; in J^+,
    squared singular values s^2 are replaced by max(s^2, min_singular_value^2). So N is exact away from
    singularities and changes continuously at them.

    The result is always finite and within the limits. If the target, the state or F is not finite, F and the
    posture term are zero, and any other term that is not finite is zero; the remaining terms brake and hold
    the arm.

    Args:
        parameters: Stiffness, damping and limits of the controller.
        limits: Joint limits.
        state: Measured state of the arm.
        target: Desired pose and twist of the tool.

    Source:
        Tanwani 2018, eq. 6.11, with a proper orientation error; Chiaverini 1997, IEEE Trans. Robotics and
        Automation 13(3), whose damping of J^+ (Nakamura & Hanafusa 1986) is applied to each singular
        direction by its own singular value, so that directions may change order.
    """
    with np.errstate(all="ignore"):  # overflow is replaced below
        joint_torque = zero_non_finite(_joint_limit_torque(parameters, limits, state.q))
        joint_torque = joint_torque - zero_non_finite(parameters.joint_damping * state.velocity)
        wrench, task = _task_torque(parameters, state, target)
        torque, torque_fraction = clip_torque(
            limits.torque, zero_non_finite(state.bias), zero_non_finite(joint_torque + task)
        )
    return ArmCommand(torque, wrench, torque_fraction)


def _task_torque(
    parameters: ImpedanceParameters, state: ArmState, target: ToolTarget
) -> tuple[Float[Array, " 6"], Float[Array, " n"]]:
    """Return F and J^T F + N k_q (q_neutral - q), or zeros if one of them is not finite."""
    J = state.jacobian
    zeros = np.zeros(6), np.zeros(J.shape[1])
    F = _wrench(parameters, state, target)
    gram = J @ J.T
    if not (np.isfinite(F).all() and np.isfinite(gram).all()):
        return zeros
    values, U = np.linalg.eigh(gram)  # squared singular values of J
    posture = parameters.posture_stiffness * (parameters.posture - state.q)
    floor = parameters.min_singular_value * parameters.min_singular_value  # inf where ** would raise
    pseudo = U @ ((U.T @ (J @ posture)) / np.maximum(values, floor))  # J^+T posture
    task = J.T @ (F - pseudo) + posture
    return (F, task) if np.isfinite(task).all() else zeros


def _wrench(parameters: ImpedanceParameters, state: ArmState, target: ToolTarget) -> Float[Array, " 6"]:
    error = np.concatenate(
        [target.position - state.position, rotation_error(state.quaternion, target.quaternion)]
    )
    spring = _limit_wrench(parameters, parameters.stiffness * error)
    twist_error = state.jacobian @ state.velocity - target.twist
    return _limit_wrench(parameters, spring - parameters.damping * twist_error)


def rotation_error(p: Float[Array, " 4"], q: Float[Array, " 4"]) -> Float[Array, " 3"]:
    """Return the rotation vector of q p^-1 in world axes, for the nearer of q and -q; NaN if one is zero.

    The lengths of p and q do not matter.
    """
    w = p @ q
    vector = p[0] * q[1:] - q[0] * p[1:] - np.cross(q[1:], p[1:])
    sine = np.sqrt(vector @ vector)
    if not abs(w) + sine > 0.0:
        return np.full(3, np.nan)
    angle = 2.0 * np.arctan2(sine, abs(w))
    return np.asarray(vector * (np.copysign(angle / sine, w) if sine > 0.0 else 0.0))


def _limit_wrench(parameters: ImpedanceParameters, wrench: Float[Array, " 6"]) -> Float[Array, " 6"]:
    """Return force and moment scaled down to their limits; NaN if a norm is not finite."""
    force, moment = np.sqrt(wrench[:3] @ wrench[:3]), np.sqrt(wrench[3:] @ wrench[3:])
    if not np.isfinite(force + moment):
        return np.full(6, np.nan)
    scales = min(1.0, parameters.force_limit / force), min(1.0, parameters.moment_limit / moment)
    return np.asarray(wrench * np.repeat(scales, 3))


def _joint_limit_torque(
    parameters: ImpedanceParameters, limits: ArmLimits, q: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Return the torque of springs that push joints away from limits nearer than the margin."""
    below = np.maximum(limits.lower + parameters.limit_margin - q, 0.0)
    above = np.maximum(q - (limits.upper - parameters.limit_margin), 0.0)
    return np.asarray(parameters.limit_stiffness * (below - above))
