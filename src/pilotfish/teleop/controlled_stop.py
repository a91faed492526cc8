"""Controlled stop: brake from the present velocity to rest, at a constant deceleration."""

from dataclasses import dataclass

import numpy as np

from pilotfish.geometry import exp_map
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, shorten_repr

SCALAR_START = 6  # columns of a velocity after these belong to scalars, which hold


@dataclass(frozen=True, slots=True)
class Braking:
    """Decelerations of a controlled stop.

    Attributes:
        linear: Deceleration [m/s^2].
        angular: Angular deceleration [rad/s^2].

    Raises:
        InvalidInput: If a deceleration is not positive and finite.
    """

    linear: float = 2.0
    angular: float = 8.0

    def __post_init__(self) -> None:
        require_number(self.linear, "linear", 1e-3, 1e3)
        require_number(self.angular, "angular", 1e-3, 1e3)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class TargetMotion:
    """Target of the arm: pose and scalars, and velocity [m/s], then angular velocity in body axes [rad/s]."""

    pose: Float[Array, " D"]
    velocity: Float[Array, " E"]


def brake(motion: TargetMotion, braking: Braking, dt: float) -> TargetMotion:
    """Return the motion after a step of braking; scalars hold.

    The target continues along its path. Its velocity falls by at most deceleration times dt, and to exactly
    zero in the last step.

    Args:
        motion: Motion before the step.
        braking: Decelerations.
        dt: Time of the step [s].
    """
    velocity = np.zeros_like(motion.velocity)
    for columns, deceleration in (
        (slice(0, 3), braking.linear),
        (slice(3, SCALAR_START), braking.angular),
    ):
        v = motion.velocity[columns]
        speed = float(np.sqrt(v @ v))
        if speed > deceleration * dt:
            velocity[columns] = v * (1.0 - deceleration * dt / speed)
    if not velocity.any():
        return TargetMotion(motion.pose, velocity)
    starts = (3,) if motion.pose.size != velocity.size else ()
    pose = exp_map(motion.pose, dt * velocity, starts)
    if starts:
        pose[3:7] /= np.sqrt(pose[3:7] @ pose[3:7])
    return TargetMotion(pose, velocity)


def stopping_point(motion: TargetMotion, braking: Braking) -> Float[Array, " 3"]:
    """Return the position at which a controlled stop would end [m].

    Args:
        motion: Motion when it begins.
        braking: Decelerations.
    """
    v = motion.velocity[:3]
    return np.asarray(motion.pose[:3] + v * np.sqrt(v @ v) / (2.0 * braking.linear))
