"""Limits of the target, applied after fusion: workspace, speed and acceleration.

Two safe inputs may blend into one that is not; the limits therefore stand at the end. The target follows the
desired pose y with its velocity and a correction of the remaining error e = y - target,

    v = v_y + g(e) e / |e|,    g(e) = min(|e| / dt, sqrt(a |e|)),

so that a desired pose within the limits is followed without lag, and a jump is approached with half the
largest deceleration. |v| is bounded by the speed, and its change by the acceleration times dt. Position and
rotation are limited separately; rotations are rotation vectors in body axes.

Walls. At the distance d from a wall of the workspace, the speed towards it is at most the solution of

    v dt + v^2 / (2 b) = d,    b = a / sqrt(3),

so that braking by b on each axis still stops at the wall, and on all three axes together does not exceed a.
After the step the distance is v^2 / (2 b), and the speed allowed is at least v - b dt' for every next dt'.
Braking comes first, and the rest of the change takes what remains of the acceleration.
"""

from dataclasses import dataclass, field

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import exp_map, log_map
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number, shorten_repr

MIN_LIMIT, MAX_LIMIT = 1e-6, 1e6
TINY = 1e-12
NO_WALLS = (-np.inf, np.inf)


def _corner(value: float) -> Float[Array, " 3"]:
    return np.full(3, value)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Limits of the target.

    Attributes:
        lower: Lower corner of the workspace [m].
        upper: Upper corner of the workspace [m].
        speed: Largest speed [m/s].
        acceleration: Largest acceleration [m/s^2].
        angular_speed: Largest angular speed [rad/s].
        angular_acceleration: Largest angular acceleration [rad/s^2].

    Raises:
        InvalidInput: If a number is not finite or not positive, or a corner is not below the other.
    """

    lower: Float[Array, " 3"] = field(default_factory=lambda: _corner(-10.0))
    upper: Float[Array, " 3"] = field(default_factory=lambda: _corner(10.0))
    speed: float = 0.5
    acceleration: float = 5.0
    angular_speed: float = 2.0
    angular_acceleration: float = 20.0

    def __post_init__(self) -> None:
        lower, upper = finite_array(self.lower, "lower", (3,)), finite_array(self.upper, "upper", (3,))
        if not (lower < upper).all():
            raise InvalidInput(
                f"lower is {lower.tolist()} and upper {upper.tolist()}, expected lower below upper"
            )
        for name in ("speed", "acceleration", "angular_speed", "angular_acceleration"):
            require_number(getattr(self, name), name, MIN_LIMIT, MAX_LIMIT)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class TargetMotion:
    """Target of the robot and how it moves.

    Attributes:
        pose: Pose and scalars.
        velocity: Velocity [m/s] and angular velocity in body axes [rad/s], then zeros for scalars.
        desired: Desired pose of the last step.
    """

    pose: Float[Array, " D"]
    velocity: Float[Array, " E"]
    desired: Float[Array, " D"]


def follow_desired(
    limits: Limits,
    motion: TargetMotion,
    desired: Float[Array, " D"],
    dt: float,
    orientation_starts: tuple[int, ...],
) -> TargetMotion:
    """Return the motion after a step towards a desired pose, within the limits.

    A target outside the workspace may move towards it but not farther away.

    Args:
        limits: Limits.
        motion: Motion before the step.
        desired: Desired pose and scalars; scalars are taken at once.
        dt: Time of the step [s].
        orientation_starts: First column of each quaternion.
    """
    desired = desired.copy()
    desired[:3] = np.clip(desired[:3], limits.lower, limits.upper)
    pose_columns = 3 + 3 * len(orientation_starts)
    v_desired = log_map(motion.desired, desired, orientation_starts) / dt
    error = log_map(motion.pose, motion.desired, orientation_starts)
    velocity = np.zeros_like(motion.velocity)
    for columns, speed, acceleration, bounds in (
        (slice(0, 3), limits.speed, limits.acceleration, _wall_speeds(limits, motion.pose[:3], dt)),
        (slice(3, pose_columns), limits.angular_speed, limits.angular_acceleration, NO_WALLS),
    ):
        distance = float(np.linalg.norm(error[columns]))
        approach = min(1.0 / dt, np.sqrt(acceleration / max(distance, TINY)))
        wanted = _shorten(v_desired[columns] + approach * error[columns], speed)
        velocity[columns] = _accelerate(motion.velocity[columns], wanted, acceleration * dt, bounds)
    pose = exp_map(motion.pose, velocity * dt, orientation_starts)
    low, high = np.minimum(limits.lower, motion.pose[:3]), np.maximum(limits.upper, motion.pose[:3])
    pose[:3] = np.clip(pose[:3], low, high)
    velocity[:3] = (pose[:3] - motion.pose[:3]) / dt
    for start in orientation_starts:
        pose[start : start + 4] /= np.linalg.norm(pose[start : start + 4])
    scalars = pose_columns + len(orientation_starts)
    pose[scalars:] = desired[scalars:]
    return TargetMotion(pose, velocity, desired)


def _wall_speeds(
    limits: Limits, position: Float[Array, " 3"], dt: float
) -> tuple[Float[Array, " 3"], Float[Array, " 3"]]:
    """Return the lowest and highest velocity of each axis, as at the head of this file."""
    b = limits.acceleration / np.sqrt(3.0)
    below, above = np.maximum(position - limits.lower, 0.0), np.maximum(limits.upper - position, 0.0)
    lowest, highest = (b * (np.sqrt(dt**2 + 2.0 * d / b) - dt) for d in (below, above))
    return -lowest, highest


def _accelerate(
    v: Float[Array, " n"],
    wanted: Float[Array, " n"],
    change: float,
    bounds: tuple[float | Float[Array, " n"], float | Float[Array, " n"]],
) -> Float[Array, " n"]:
    """Return the velocity towards the one wanted after a change of at most this norm, braking first."""
    braked, wanted = np.clip(v, *bounds), np.clip(wanted, *bounds)
    braking, rest = braked - v, wanted - braked
    squared, product = float(rest @ rest), float(braking @ rest)
    left = max(0.0, change**2 - float(braking @ braking))
    if squared + 2.0 * product <= left:
        return wanted
    return np.asarray(braked + rest * (np.sqrt(product**2 + squared * left) - product) / squared)


def _shorten(v: Float[Array, " n"], length: float) -> Float[Array, " n"]:
    norm = float(np.linalg.norm(v))
    return v if norm <= length else v * (length / norm)
