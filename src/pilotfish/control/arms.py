"""Holding and moving an arm: springs and dampers at its tool, or at its joints."""

import numpy as np

from pilotfish import kernels
from pilotfish.kernels import ArmCommand, ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.types import Array, Float


def impedance_torque(
    impedance: ImpedanceParameters, limits: ArmLimits, reading: ArmState, target: ToolTarget
) -> ArmCommand:
    """The torques that hold the tool at its target as if by springs and dampers, the arm in its posture.

    tau = bias + J^T F + (I - J^T J^+T) k_q (q_neutral - q) - k_v q' + limit_stiffness depth, where
    F = K e - D (J q' - twist) within force_limit and moment_limit, as K e is by itself before: so the spring
    alone moves a tool no faster than limit over damping. e is the way to the target and the turn, world
    axes, the shorter way round. depth is how far a joint is inside limit_margin of a limit. Torques are
    cut to their limits joint by joint: one that hardly carries its own weight must not stop the others.
    Never raises, always finite: without a finite target or reading the tool is not pulled nor the posture
    kept (F = 0); what remains brakes, keeps off limits and carries the bias, each joint where it is finite.
    Source: Tanwani 2018, eq. 6.11, with a proper orientation error; Chiaverini 1997 for J^+ near singular
    postures, as the kernel `impedance` tells.
    """
    return kernels.impedance(impedance, limits, reading, target)


def posture_torque(
    stiffness: float | Float[Array, " n"],
    damping: float | Float[Array, " n"],
    limits: ArmLimits,
    reading: ArmState,
    posture: Float[Array, " n"],
) -> ArmCommand:
    """The torques that hold joints at a posture [rad], cut to their limits, by springs and dampers.

    tau = bias + stiffness [N m/rad] (posture - q) - damping [N m s/rad] q'; wrench is zero. As in
    impedance_torque nothing raises, and terms that are not finite push nothing.
    """
    with np.errstate(all="ignore"):
        clipped_posture = np.minimum(np.maximum(posture, limits.lower), limits.upper)
        spring = kernels.zero_non_finite(stiffness * (clipped_posture - reading.q))
        feedback_torque = kernels.zero_non_finite(
            spring - kernels.zero_non_finite(damping * reading.velocity)
        )
        torque, torque_fraction = kernels.clip_torque(
            limits.torque, kernels.zero_non_finite(reading.bias), feedback_torque
        )
    return ArmCommand(torque, np.zeros(6), torque_fraction)
