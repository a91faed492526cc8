"""The torques with which an arm's tool is held by springs and dampers."""

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


def impedance(
    impedance: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> ArmCommand:
    """Tau = bias + J^T F + N k_q (q_neutral - q) - k_v q' + what keeps off the joints' limits, cut to limits.

    F = K e - D (J q' - twist), e the way to the target and the turn to it; K e alone and F are shortened to
    the limits on force and moment. N = I - J^T J^+T; in J^+ squared singular values s^2 are replaced by
    max(s^2, singular_value^2), so N is exact, or fades into more than the null space, without a step.
    Always finite and within limits: without a finite task (a target or a reading that is not) F and the
    posture push nothing, nor does any other term that is not finite; what is left brakes and holds.
    Source: Tanwani 2018, eq. 6.11, the orientation error made proper; Chiaverini 1997, IEEE Trans. Robotics
    and Automation 13(3), its damping of J^+ (Nakamura & Hanafusa 1986) given to each singular direction by
    its own singular value, so that directions may change places.
    """
    with np.errstate(all="ignore"):  # what overflows is found below
        joint_torque = zero_non_finite(_joint_limit_torque(impedance, limits, state.q))
        joint_torque = joint_torque - zero_non_finite(impedance.joint_damping * state.velocity)
        wrench, task = _task_torque(impedance, state, target)
        torque, torque_fraction = clip_torque(
            limits.torque, zero_non_finite(state.bias), zero_non_finite(joint_torque + task)
        )
    return ArmCommand(torque, wrench, torque_fraction)


def _task_torque(
    impedance: ImpedanceParameters, state: ArmState, target: ToolTarget
) -> tuple[Float[Array, " 6"], Float[Array, " n"]]:
    """F and J^T F + N k_q (q_neutral - q), or zeros when one of them is not finite."""
    J = state.jacobian
    zeros = np.zeros(6), np.zeros(J.shape[1])
    F = _wrench(impedance, state, target)
    gram = J @ J.T
    if not (np.isfinite(F).all() and np.isfinite(gram).all()):
        return zeros
    values, U = np.linalg.eigh(gram)  # squared singular values of J
    posture = impedance.posture_stiffness * (impedance.posture - state.q)
    least = (
        impedance.min_singular_value * impedance.min_singular_value
    )  # inf where ** would raise OverflowError
    pseudo = U @ ((U.T @ (J @ posture)) / np.maximum(values, least))  # J^+T posture
    task = J.T @ (F - pseudo) + posture
    return (F, task) if np.isfinite(task).all() else zeros


def _wrench(impedance: ImpedanceParameters, state: ArmState, target: ToolTarget) -> Float[Array, " 6"]:
    error = np.concatenate(
        [target.position - state.position, rotation_error(state.quaternion, target.quaternion)]
    )
    spring = _limit_wrench(impedance, impedance.stiffness * error)
    twist_error = state.jacobian @ state.velocity - target.twist
    return _limit_wrench(impedance, spring - impedance.damping * twist_error)


def rotation_error(p: Float[Array, " 4"], q: Float[Array, " 4"]) -> Float[Array, " 3"]:
    """The rotation vector of q p^-1, world axes, of q or -q the nearer one; not finite where one is zero.

    Lengths of p and q do not matter.
    """
    w = p @ q
    vector = p[0] * q[1:] - q[0] * p[1:] - np.cross(q[1:], p[1:])
    sine = np.sqrt(vector @ vector)
    if not abs(w) + sine > 0.0:
        return np.full(3, np.nan)
    angle = 2.0 * np.arctan2(sine, abs(w))
    return np.asarray(vector * (np.copysign(angle / sine, w) if sine > 0.0 else 0.0))


def _limit_wrench(impedance: ImpedanceParameters, wrench: Float[Array, " 6"]) -> Float[Array, " 6"]:
    """The same directions, force and moment no longer than their limits; not finite where a norm is not."""
    force, moment = np.sqrt(wrench[:3] @ wrench[:3]), np.sqrt(wrench[3:] @ wrench[3:])
    if not np.isfinite(force + moment):
        return np.full(6, np.nan)
    shares = min(1.0, impedance.force_limit / force), min(1.0, impedance.moment_limit / moment)
    return np.asarray(wrench * np.repeat(shares, 3))


def _joint_limit_torque(
    impedance: ImpedanceParameters, limits: ArmLimits, q: Float[Array, " n"]
) -> Float[Array, " n"]:
    """A spring that pushes each joint away from a limit nearer than the margin."""
    below = np.maximum(limits.lower + impedance.limit_margin - q, 0.0)
    above = np.maximum(q - (limits.upper - impedance.limit_margin), 0.0)
    return np.asarray(impedance.limit_stiffness * (below - above))
