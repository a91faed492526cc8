"""Bumpless transfer and limits of the target.

Transfer. A change of mode, skill or clutch does not move the target at once. At a change the new desired pose
y differs from the target by d = log_y(target). The blended pose

    exp_y((1 - m(t / T)) d),    m the minimum-jerk profile,

starts at the target, and follows y alone after T. T is such that the blend never moves faster than 0.25 m/s
and 1 rad/s relative to y, and not shorter than 0.3 s.

Limits. Two safe inputs may blend into one that is not; the limits therefore stand at the end. The target
follows the desired pose y with its velocity and a correction of the remaining error e = y - target,

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

import numpy as np

from pilotfish.kernels.assistance_types import AssistanceSettings
from pilotfish.kernels.reference import manifold
from pilotfish.types import Array, Float

BLEND_SPEED, BLEND_ANGULAR_SPEED = 0.25, 1.0  # m/s, rad/s
MIN_BLEND = 0.3  # s
PEAK = 1.875  # of the velocity of a minimum-jerk movement, relative to its mean
TINY = 1e-12
ORIENTATION_STARTS: tuple[tuple[int, ...], ...] = ((), (3,))
NO_WALLS = (-np.inf, np.inf)


def deviation(base: Float[Array, " D"], x: Float[Array, " D"], is_oriented: bool) -> Float[Array, " E"]:
    """Return the tangent vector at base whose geodesic reaches x.

    Args:
        base: Pose and scalars.
        x: Pose and scalars.
        is_oriented: Whether a quaternion follows the position.
    """
    return np.asarray(manifold.deviations(x[None], base, ORIENTATION_STARTS[is_oriented])[0])


def displaced(base: Float[Array, " D"], v: Float[Array, " E"], is_oriented: bool) -> Float[Array, " D"]:
    """Return the pose that the geodesic from base along v reaches.

    Args:
        base: Pose and scalars.
        v: Tangent vector.
        is_oriented: Whether a quaternion follows the position.
    """
    return manifold.displaced(base, v, ORIENTATION_STARTS[is_oriented])


def blend_duration(offset: Float[Array, " E"]) -> float:
    """Return the time T of a blend.

    Args:
        offset: Deviation of the target from the desired pose, zero for scalars.
    """
    distance, angle = (float(np.sqrt(v @ v)) for v in (offset[:3], offset[3:6]))
    return max(MIN_BLEND, PEAK * distance / BLEND_SPEED, PEAK * angle / BLEND_ANGULAR_SPEED)


def blend(
    desired: Float[Array, " D"],
    offset: Float[Array, " E"],
    elapsed: float,
    duration: float,
    is_oriented: bool,
) -> Float[Array, " D"]:
    """Return the desired pose with what remains of the offset.

    Args:
        desired: Desired pose and scalars.
        offset: Deviation of the target from the desired pose at the change.
        elapsed: Time since the change [s].
        duration: Time after which the offset is zero [s].
        is_oriented: Whether a quaternion follows the position.
    """
    if elapsed >= duration:
        return desired
    s = elapsed / duration
    remaining = 1.0 - s**3 * (10.0 - s * (15.0 - 6.0 * s))
    return displaced(desired, remaining * offset, is_oriented)


def follow_desired(
    limits: AssistanceSettings,
    motion: tuple[Float[Array, " D"], Float[Array, " E"], Float[Array, " D"]],
    desired: Float[Array, " D"],
    dt: float,
) -> tuple[Float[Array, " D"], Float[Array, " E"], Float[Array, " D"]]:
    """Return the motion after a step towards a desired pose, within the limits.

    A target outside the workspace may move towards it but not farther away.

    Args:
        limits: Limits.
        motion: Pose, velocity and desired pose of the step before.
        desired: Desired pose and scalars; scalars are taken at once.
        dt: Time of the step [s].
    """
    before, v, desired_before = motion
    is_oriented = len(before) != len(v)
    desired = desired.copy()
    desired[:3] = np.clip(desired[:3], limits.lower, limits.upper)
    v_desired = deviation(desired_before, desired, is_oriented) / dt
    error = deviation(before, desired_before, is_oriented)
    velocity = np.zeros_like(v)
    for columns, speed, acceleration, bounds in (
        (slice(0, 3), limits.speed, limits.acceleration, _wall_speeds(limits, before[:3], dt)),
        (slice(3, 6), limits.angular_speed, limits.angular_acceleration, NO_WALLS),
    )[: 1 + is_oriented]:
        distance = float(np.sqrt(error[columns] @ error[columns]))
        approach = min(1.0 / dt, np.sqrt(acceleration / max(distance, TINY)))
        wanted = _shorten(v_desired[columns] + approach * error[columns], speed)
        velocity[columns] = _accelerate(v[columns], wanted, acceleration * dt, bounds)
    pose = displaced(before, velocity * dt, is_oriented)
    low, high = np.minimum(limits.lower, before[:3]), np.maximum(limits.upper, before[:3])
    pose[:3] = np.clip(pose[:3], low, high)
    velocity[:3] = (pose[:3] - before[:3]) / dt
    if is_oriented:
        pose[3:7] /= np.sqrt(pose[3:7] @ pose[3:7])
    scalars = 7 if is_oriented else 3
    pose[scalars:] = desired[scalars:]
    return pose, velocity, desired


def _wall_speeds(
    limits: AssistanceSettings, position: Float[Array, " 3"], dt: float
) -> tuple[Float[Array, " 3"], Float[Array, " 3"]]:
    """Return the lowest and highest velocity of each axis, as at the head of this file."""
    b = limits.acceleration / np.sqrt(3.0)
    below, above = np.maximum(position - limits.lower, 0.0), np.maximum(limits.upper - position, 0.0)
    lowest, highest = (b * (np.sqrt(dt * dt + 2.0 * d / b) - dt) for d in (below, above))
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
    left = max(0.0, change * change - float(braking @ braking))
    if squared + 2.0 * product <= left:
        return wanted
    return np.asarray(braked + rest * (np.sqrt(product * product + squared * left) - product) / squared)


def _shorten(v: Float[Array, " n"], length: float) -> Float[Array, " n"]:
    norm = float(np.sqrt(v @ v))
    return v if norm <= length else v * (length / norm)
