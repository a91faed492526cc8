"""Joints that bring a tool to a pose, within their limits."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control.chains import SerialChain, chain_frames
from pilotfish.geometry import Pose, quaternion_from_rotation_matrix, relative_rotation_vector
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Bool, Float

POSITION_TOLERANCE, ANGLE_TOLERANCE = 1e-6, 1e-5  # m, rad: far finer than an arm
MIN_DAMPING = 1e-10  # beside the error's own, which vanishes with it
MAX_JOINT_STEP = 0.5  # rad of a joint: as far as a linear model of an arm tells something
POSTURE_GAIN = 0.5  # of the way to the posture that is left
MIN_JOINT_STEP = 1e-6  # rad: what no joint moves any more


@dataclass(frozen=True, slots=True, eq=False)
class InverseKinematicsResult:
    """How near joints within their limits come to a pose; converged: within 1e-6 m and 1e-5 rad."""

    q: Float[Array, " n"]
    position_error: float  # m
    angle_error: float  # rad
    converged: bool


def inverse_kinematics(
    chain: SerialChain,
    target: Pose,
    start: Float[Array, " n"],
    limits: ArmLimits,
    *,
    posture: Float[Array, " n"] | None = None,
    max_iterations: int = 200,
) -> InverseKinematicsResult:
    """Joints that bring the tool to world_from_tool = target, from a start [rad], never outside their limits.

    Of redundant joints those nearer to posture, if one is given. One start leads to one answer, always the
    same; a pose that is not reached from here is an outcome: the nearest that was seen, not converged.
    Source: Sugihara 2011, IEEE Trans. Robotics 27(5), damping by the error; joints at a limit that would
    leave it are held there; the posture enters in the null space of what is left.
    """
    q = np.clip(start, limits.lower, limits.upper)
    J, error = _jacobian_and_error(chain, target, q)
    best = _result(q, error)
    for _ in range(max_iterations):
        step = _bounded_step(J, error, q, limits, posture)
        if np.abs(step).max() < MIN_JOINT_STEP or (best.converged and posture is None):
            break
        q = np.clip(q + step, limits.lower, limits.upper)
        J, error = _jacobian_and_error(chain, target, q)
        candidate = _result(q, error)
        if candidate.converged or (_squared_error(candidate) < _squared_error(best) and not best.converged):
            best = candidate  # of those that converge the last, for it is nearest to the posture
    return best


def _jacobian_and_error(
    chain: SerialChain, target: Pose, q: Float[Array, " n"]
) -> tuple[Float[Array, "6 n"], Float[Array, " 6"]]:
    """The Jacobian, and the way and the turn that are left, in world axes."""
    frames = chain_frames(chain, q)
    turn = relative_rotation_vector(quaternion_from_rotation_matrix(frames.rotation), target.quaternion)
    return frames.jacobian, np.concatenate([target.position - frames.tool, frames.rotation @ turn])


def _result(q: Float[Array, " n"], error: Float[Array, " 6"]) -> InverseKinematicsResult:
    distance, angle = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
    return InverseKinematicsResult(
        q, distance, angle, distance < POSITION_TOLERANCE and angle < ANGLE_TOLERANCE
    )


def _squared_error(reach: InverseKinematicsResult) -> float:
    return reach.position_error**2 + reach.angle_error**2


def _bounded_step(
    J: Float[Array, "6 n"],
    error: Float[Array, " 6"],
    q: Float[Array, " n"],
    limits: ArmLimits,
    posture: Float[Array, " n"] | None,
) -> Float[Array, " n"]:
    """A step of the free joints: those at a limit that it would leave are held, one set after another."""
    posture_step = np.zeros_like(q) if posture is None else POSTURE_GAIN * (posture - q)
    free: Bool[Array, " n"] = np.ones(len(q), dtype=bool)
    for _ in q:
        step = _damped_step(J * free, error, posture_step * free)
        leaving_limits = free & np.where(step < 0.0, q <= limits.lower, (q >= limits.upper) & (step > 0.0))
        if not leaving_limits.any():
            break
        free &= ~leaving_limits
    return step * min(1.0, MAX_JOINT_STEP / max(float(np.abs(step).max()), MAX_JOINT_STEP))


def _damped_step(
    J: Float[Array, "6 n"], error: Float[Array, " 6"], posture_step: Float[Array, " n"]
) -> Float[Array, " n"]:
    """J^T (J J^T + (|error|^2 / 2 + least) I)^-1 error + (I - J^+ J) aside."""
    gram, damping = J @ J.T, MIN_DAMPING + 0.5 * float(error @ error)
    task_multipliers = np.linalg.solve(gram + damping * np.eye(6), error)
    back = np.linalg.solve(gram + MIN_DAMPING * np.eye(6), J @ posture_step)
    return np.asarray(posture_step + J.T @ (task_multipliers - back))
