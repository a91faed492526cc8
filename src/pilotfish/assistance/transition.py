"""Bumpless transfer: a change of mode, skill or clutch does not move the target at once, but blends.

At a change the new desired pose y differs from the target by d = log_y(target). The blended pose

    exp_y((1 - m(t / T)) d),    m the minimum-jerk profile,

starts at the target, and follows y alone after T. T is such that the blend never moves faster than 0.25 m/s
and 1 rad/s relative to y, and not shorter than 0.3 s.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish.geometry import exp_map, log_map, minimum_jerk
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

SPEED, ANGULAR_SPEED = 0.25, 1.0  # m/s, rad/s
MIN_DURATION = 0.3  # s
PEAK = 1.875  # of the velocity of a minimum-jerk movement, relative to its mean


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Transition:
    """A blend from the target to a new desired pose.

    Attributes:
        offset: Deviation of the target from the desired pose at the change; zero for scalars.
        elapsed: Time since the change [s].
        duration: Time after which the offset is zero [s].
    """

    offset: Float[Array, " E"]
    elapsed: float
    duration: float

    def blend(self, desired: Float[Array, " D"], orientation_starts: tuple[int, ...]) -> Float[Array, " D"]:
        """Return the desired pose with what remains of the offset.

        Args:
            desired: Desired pose and scalars.
            orientation_starts: First column of each quaternion.
        """
        if self.elapsed >= self.duration:
            return desired
        remaining = 1.0 - float(minimum_jerk(np.array(self.elapsed / self.duration)))
        return exp_map(desired, remaining * self.offset, orientation_starts)


def begin_transition(
    desired: Float[Array, " D"], target: Float[Array, " D"], orientation_starts: tuple[int, ...]
) -> Transition:
    """Return the transition from a target to a new desired pose.

    Args:
        desired: New desired pose and scalars.
        target: Target before the change.
        orientation_starts: First column of each quaternion.
    """
    offset = log_map(desired, target, orientation_starts)
    width = 3 + 3 * len(orientation_starts)
    offset[width:] = 0.0
    distance, angle = float(np.linalg.norm(offset[:3])), float(np.linalg.norm(offset[3:width]))
    duration = max(MIN_DURATION, PEAK * distance / SPEED, PEAK * angle / ANGULAR_SPEED)
    return Transition(offset, 0.0, duration)
