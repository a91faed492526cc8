"""Joints that bring a tool to a pose, within their limits."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control.chains import SerialChain, chain_frames
from pilotfish.geometry import Pose, from_rotation_matrix, rotation_vector
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Bool, Float

POSITION_PRECISION, ANGLE_PRECISION = 1e-6, 1e-5  # m, rad: far finer than an arm
LEAST_DAMPING = 1e-10  # beside the error's own, which vanishes with it
LONGEST_STEP = 0.5  # rad of a joint: as far as a linear model of an arm tells something
POSTURE_STEP = 0.5  # of the way to the posture that is left
STILL = 1e-6  # rad: what no joint moves any more


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
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
    steps: int = 200,
) -> Reach:
    """Joints that bring the tool to world_from_tool = target, from a start [rad], never outside their limits.

    Of redundant joints those nearer to posture, if one is given. One start leads to one answer, always the
    same; a pose that is not reached from here is an outcome: the nearest that was seen, not converged.
    Source: Sugihara 2011, IEEE Trans. Robotics 27(5), damping by the error; joints at a limit that would
    leave it are held there; the posture enters in the null space of what is left.
    """
    q = np.clip(start, limits.lower, limits.upper)
    J, error = _linearised(chain, target, q)
    best = _reach(q, error)
    for _ in range(steps):
        step = _step(J, error, q, limits, posture)
        if np.abs(step).max() < STILL or (best.converged and posture is None):
            break
        q = np.clip(q + step, limits.lower, limits.upper)
        J, error = _linearised(chain, target, q)
        here = _reach(q, error)
        if here.converged or (_size(here) < _size(best) and not best.converged):
            best = here  # of those that converge the last, for it is nearest to the posture
    return best


def _linearised(
    chain: SerialChain, target: Pose, q: Float[Array, " n"]
) -> tuple[Float[Array, "6 n"], Float[Array, " 6"]]:
    """The Jacobian, and the way and the turn that are left, in world axes."""
    frames = chain_frames(chain, q)
    turn = rotation_vector(from_rotation_matrix(frames.rotation), target.quaternion)
    return frames.jacobian, np.concatenate([target.position - frames.tool, frames.rotation @ turn])


def _reach(q: Float[Array, " n"], error: Float[Array, " 6"]) -> Reach:
    way, angle = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
    return Reach(q, way, angle, way < POSITION_PRECISION and angle < ANGLE_PRECISION)


def _size(reach: Reach) -> float:
    return reach.position_error**2 + reach.angle_error**2


def _step(
    J: Float[Array, "6 n"],
    error: Float[Array, " 6"],
    q: Float[Array, " n"],
    limits: ArmLimits,
    posture: Float[Array, " n"] | None,
) -> Float[Array, " n"]:
    """A step of the free joints: those at a limit that it would leave are held, one set after another."""
    aside = np.zeros_like(q) if posture is None else POSTURE_STEP * (posture - q)
    free: Bool[Array, " n"] = np.ones(len(q), dtype=bool)
    for _ in q:
        step = _damped(J * free, error, aside * free)
        leaving = free & np.where(step < 0.0, q <= limits.lower, (q >= limits.upper) & (step > 0.0))
        if not leaving.any():
            break
        free &= ~leaving
    return step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), LONGEST_STEP))


def _damped(
    J: Float[Array, "6 n"], error: Float[Array, " 6"], aside: Float[Array, " n"]
) -> Float[Array, " n"]:
    """J^T (J J^T + (|error|^2 / 2 + least) I)^-1 error + (I - J^+ J) aside."""
    gram, damping = J @ J.T, LEAST_DAMPING + 0.5 * float(error @ error)
    towards = np.linalg.solve(gram + damping * np.eye(6), error)
    back = np.linalg.solve(gram + LEAST_DAMPING * np.eye(6), J @ aside)
    return np.asarray(aside + J.T @ (towards - back))
