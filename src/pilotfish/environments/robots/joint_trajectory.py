"""A tool path as joint positions at the rate of a robot's controller."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pilotfish.control import inverse_kinematics
from pilotfish.environments.robots.robot import (
    REACH_TOLERANCE,
    Robot,
    chain_with_tool,
    solve_posture,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, normalise
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number, require_type, shorten_repr

CONTROLLER_PERIOD = 0.002  # s: 500 Hz
MIN_PERIOD, MAX_PERIOD = 1e-4, 10.0  # s
MAX_ROWS, MAX_SAMPLES = 100_000, 10_000_000
MIN_NORM = 1e-3  # of a quaternion, which is normalised
POSE = 7


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class JointTrajectory:
    """Motion of the joints at the rate of a controller.

    Attributes:
        joint_names: Names of the joints.
        times: Time of each sample [s], from 0.
        q: Joint positions [rad].
        velocity: Joint velocities [rad/s], zero at both ends.
        max_deviation: Largest distance of the tool from the path between two of its rows [m].
    """

    joint_names: tuple[str, ...]
    times: Float[Array, " T"]
    q: Float[Array, "T n"]
    velocity: Float[Array, "T n"]
    max_deviation: float


def joint_trajectory(
    robot: Robot,
    poses: Float[Array, "S 7"],
    period: float,
    *,
    controller_period: float = CONTROLLER_PERIOD,
    tool_length: float = 0.0,
    start: Float[Array, " n"] | None = None,
) -> JointTrajectory:
    """Return joint positions and velocities that move a robot's tool along a path.

    Inverse kinematics gives the joints at each row of the path, from those of the row before; a redundant arm
    stays near its first posture. A cubic spline through them, at rest at both ends, is sampled at the rate of
    the controller. Positions and speeds are checked against the robot's limits. Torques are not checked.

    Args:
        robot: Robot from `ROBOTS`, or from `robot_from_file`.
        poses: Rows of tool position [m] and quaternion w x y z of any length, in torso axes: two or more.
            `reproduction.motion.x[:, :7]` of a skill with poses.
        period: Time between rows [s].
        controller_period: Time between samples [s].
        tool_length: Distance of the tool point from the hand [m].
        start: Joint positions from which those of the first row are searched [rad]; None for the robot's
            nominal posture.

    Raises:
        InvalidInput: If the robot does not reach a row, the motion exceeds a limit, or an argument cannot be
            used. The message says at which time, and by which factor the motion is too fast.
    """
    require_type(robot, "robot", Robot, "take one from ROBOTS")
    rows = _validate_poses(poses)
    for value, name in ((period, "period"), (controller_period, "controller_period")):
        require_number(value, name, MIN_PERIOD, MAX_PERIOD)
    if period * (len(rows) - 1) / controller_period > MAX_SAMPLES:
        raise InvalidInput(
            f"controller_period {controller_period:g} s gives more than {MAX_SAMPLES} samples; enlarge it"
        )
    q = _solve_rows(robot, rows, period, tool_length, start)
    times = period * np.arange(len(rows))
    spline = CubicSpline(times, q, bc_type="clamped")
    samples = np.arange(0.0, times[-1] + 0.5 * controller_period, controller_period)
    samples = np.minimum(samples, times[-1])
    positions, velocities = spline(samples), spline(samples, 1)
    _check_limits(robot, samples, positions, velocities)
    deviation = _max_deviation(robot, rows, spline, times, tool_length)
    return JointTrajectory(robot.joint_names, samples, positions, velocities, deviation)


def _validate_poses(poses: object) -> Float[Array, "S 7"]:
    rows = finite_array(poses, "poses")
    if rows.ndim != 2 or rows.shape[1] != POSE or not 2 <= len(rows) <= MAX_ROWS:
        raise InvalidInput(
            f"poses has shape {rows.shape}, expected (S, 7) with S from 2 to {MAX_ROWS}: position and "
            "quaternion of each step; pass reproduction.motion.x[:, :7]"
        )
    norms = np.linalg.norm(rows[:, 3:], axis=1)
    if norms.min() < MIN_NORM:
        raise InvalidInput(
            f"poses has a quaternion of length {norms.min():.3g} in row {norms.argmin()}, expected at least "
            f"{MIN_NORM:g}; the identity is 1, 0, 0, 0"
        )
    return np.concatenate([rows[:, :3], normalise(rows[:, 3:])], axis=1)


def _solve_rows(
    robot: Robot,
    rows: Float[Array, "S 7"],
    period: float,
    tool_length: float,
    start: Float[Array, " n"] | None,
) -> Float[Array, "S n"]:
    """Return the joints at each row, each searched from the row before."""
    chain = chain_with_tool(robot, tool_length)
    first = Pose(rows[0, :3], rows[0, 3:])
    if start is None:
        posture = solve_posture(robot, first, tool_length)
    else:
        posture = finite_array(start, "start", (len(robot.joint_names),))
    q, found = posture, []
    for n, row in enumerate(rows):
        target = Pose(row[:3], row[3:])
        q, distance, angle, _ = inverse_kinematics(chain, target, q, robot.limits, posture=posture)
        if max(distance, angle) > REACH_TOLERANCE:
            raise InvalidInput(
                f"{robot.name} does not reach row {n} of poses (at {n * period:.2f} s), position "
                f"{np.round(row[:3], 3).tolist()} m: the nearest posture is {distance:.3g} m and {angle:.3g} "
                "rad away; move the robot's base or the objects, or start from another posture"
            )
        found.append(q)
    return np.stack(found)


def _check_limits(
    robot: Robot, times: Float[Array, " T"], q: Float[Array, "T n"], velocity: Float[Array, "T n"]
) -> None:
    limits = robot.limits
    beyond = np.maximum(limits.lower - q, q - limits.upper)
    if beyond.max() > 1e-6:
        t, j = np.unravel_index(beyond.argmax(), beyond.shape)
        raise InvalidInput(
            f"joint {robot.joint_names[j]} of {robot.name} would pass its limit by {beyond[t, j]:.3g} rad at "
            f"{times[t]:.2f} s; move the robot's base, or start from another posture"
        )
    share = abs(velocity) / limits.velocity
    if share.max() > 1.0:
        t, j = np.unravel_index(share.argmax(), share.shape)
        raise InvalidInput(
            f"joint {robot.joint_names[j]} of {robot.name} would turn at {abs(velocity[t, j]):.3g} rad/s at "
            f"{times[t]:.2f} s, its limit is {limits.velocity[j]:.3g} rad/s; make period {share.max():.3g} "
            "times as long, or start from another posture"
        )


def _max_deviation(
    robot: Robot,
    rows: Float[Array, "S 7"],
    spline: CubicSpline,
    times: Float[Array, " S"],
    tool_length: float,
) -> float:
    """Return the largest distance of the tool from the middle between two rows [m]."""
    middles = spline(0.5 * (times[:-1] + times[1:]))
    tools = chain_with_tool(robot, tool_length).tool_poses(middles)
    return float(np.linalg.norm(tools[:, :3] - 0.5 * (rows[:-1, :3] + rows[1:, :3]), axis=1).max())
