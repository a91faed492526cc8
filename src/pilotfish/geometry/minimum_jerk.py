"""Minimum-jerk time profile of a movement from rest to rest."""

import numpy as np

from pilotfish.types import Array, Float


def minimum_jerk(s: Float[Array, "*B"]) -> Float[Array, "*B"]:
    """Return the fraction of a minimum-jerk movement that is completed: 10 s^3 - 15 s^4 + 6 s^5.

    Velocity and acceleration are zero at both ends; the peak velocity, at s = 1/2, is 1.875 times the mean.

    Args:
        s: Fraction of the duration; the result is 0 before s = 0 and 1 after s = 1.

    Source:
        Flash & Hogan 1985, J. Neuroscience 5(7).
    """
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 - s * (15.0 - 6.0 * s)))
