"""The smoothest way from rest to rest: what share is done after the share s of the time.

Source: Flash & Hogan 1985, J. Neuroscience 5(7).
"""

import numpy as np

from pilotfish.types import Array, Float

PEAK_TO_MEAN_SPEED = 1.875  # minimum_jerk_speed(1 / 2): the peak speed over the mean speed


def minimum_jerk(s: Float[Array, "*B"]) -> Float[Array, "*B"]:
    """10 s^3 - 15 s^4 + 6 s^5: nothing before s = 0, all after s = 1."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - s * (15.0 - 6.0 * s)))


def minimum_jerk_speed(s: Float[Array, "*B"]) -> Float[Array, "*B"]:
    """The derivative of minimum_jerk, 30 s^2 (1 - s)^2: nothing at either end and outside."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(30.0 * (s * (1.0 - s)) ** 2)


def minimum_jerk_acceleration(s: Float[Array, "*B"]) -> Float[Array, "*B"]:
    """The derivative of minimum_jerk_speed, 60 s (1 - s) (1 - 2 s): nothing at either end and outside."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(60.0 * s * (1.0 - s) * (1.0 - 2.0 * s))
