"""Inverse kinematics: joint angles within their limits that bring the tool to a pose.

Each step solves a damped least-squares problem for the free joints. The damping is half the squared error, so
that steps are short far from the target and Newton-like near it. A joint at a limit that the step would cross
is held, and the step is solved again without it. A desired posture enters in the null space of the Jacobian.
"""

import numpy as np

from pilotfish.control.serial_chain import SerialChain, jacobian_from_joints, joint_frames
from pilotfish.geometry import Pose, quaternion_from_rotation_matrix, relative_rotation_vector
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import finite_array, require_type

POSITION_TOLERANCE, ANGLE_TOLERANCE = 1e-6, 1e-5  # m, rad: far below the accuracy of an arm
MIN_DAMPING = 1e-10  # added to the damping by the error, which vanishes with it
MAX_JOINT_STEP = 0.5  # rad; beyond, the linear model of an arm is too inaccurate
POSTURE_GAIN = 0.5  # fraction of the distance to the posture per step
MIN_JOINT_STEP = 1e-6  # rad; the search ends if no joint moves further


# Joint angles [rad], distance [m] and angle [rad] to the target, and whether both are within tolerance
Solution = tuple[Float[Array, " n"], float, float, bool]


def inverse_kinematics(
    chain: SerialChain,
    target: Pose,
    start: Float[Array, " n"],
    limits: ArmLimits,
    *,
    posture: Float[Array, " n"] | None = None,
    max_iterations: int = 200,
) -> Solution:
    """Find joint angles within their limits that bring the tool to a pose.

    Args:
        chain: Kinematics of the arm.
        target: world_from_tool.
        start: Joint angles from which the search begins [rad]; one start always gives the same result.
        limits: Limits of the joints.
        posture: Joint angles that a redundant arm prefers [rad]; None for no preference.
        max_iterations: Largest number of steps.

    Returns:
        Joint angles [rad], distance to the target [m], angle to the target [rad], and whether these are below
        1e-6 m and 1e-5 rad. If the pose is not reached, the joint angles are the nearest ones found.

    Raises:
        InvalidInput: If a number is not finite, or joints differ in number from those of the chain.

    Source:
        Sugihara 2011, IEEE Trans. Robotics 27(5), damping by the error; added here are the joints that are
        held at a limit, and the posture in the null space.
    """
    _require_target(target)
    joints = (len(chain.positions),)
    finite_array(limits.lower, "the lower limits", joints)
    if posture is not None:
        finite_array(posture, "posture", joints)
    q = np.clip(finite_array(start, "start", joints), limits.lower, limits.upper)
    J, error = _jacobian_and_error(chain, target, q)
    best = _result(q, error)
    for _ in range(max_iterations):
        step = _bounded_step(J, error, q, limits, posture)
        if np.abs(step).max() < MIN_JOINT_STEP or (best[3] and posture is None):
            break
        q = np.clip(q + step, limits.lower, limits.upper)
        J, error = _jacobian_and_error(chain, target, q)
        candidate = _result(q, error)
        if candidate[3] or (_squared_error(candidate) < _squared_error(best) and not best[3]):
            best = candidate  # the last converged candidate is the nearest to the posture
    return best


def _require_target(target: Pose) -> None:
    require_type(target, "target", Pose, "geometry.pose(position, quaternion) creates one")
    finite_array(target.position, "the position of the target", (3,))
    finite_array(target.quaternion, "the quaternion of the target", (4,))


def _jacobian_and_error(
    chain: SerialChain, target: Pose, q: Float[Array, " n"]
) -> tuple[Float[Array, "6 n"], Float[Array, " 6"]]:
    """Return the Jacobian, and the remaining translation and rotation vector in world axes."""
    joints, axes, position, R = joint_frames(chain, q)
    rotation = relative_rotation_vector(quaternion_from_rotation_matrix(R), target.quaternion)
    error = np.concatenate([target.position - position, R @ rotation])
    return jacobian_from_joints(joints, axes, position), error


def _result(q: Float[Array, " n"], error: Float[Array, " 6"]) -> Solution:
    distance, angle = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
    converged = distance < POSITION_TOLERANCE and angle < ANGLE_TOLERANCE
    return q, distance, angle, converged


def _squared_error(solution: Solution) -> float:
    _, distance, angle, _ = solution
    return distance**2 + angle**2


def _bounded_step(
    J: Float[Array, "6 n"],
    error: Float[Array, " 6"],
    q: Float[Array, " n"],
    limits: ArmLimits,
    posture: Float[Array, " n"] | None,
) -> Float[Array, " n"]:
    """Compute a step of the free joints, holding those at a limit that they would cross."""
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
    """Compute J' (J J' + (|error|^2 / 2 + min) I)^-1 error + (I - J^+ J) posture_step."""
    gram, damping = J @ J.T, MIN_DAMPING + 0.5 * float(error @ error)
    task = np.linalg.solve(gram + damping * np.eye(6), error)
    null_space = np.linalg.solve(gram + MIN_DAMPING * np.eye(6), J @ posture_step)
    return np.asarray(posture_step + J.T @ (task - null_space))
