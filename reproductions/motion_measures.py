"""Measures of a motion beside the demonstration that it should equal, and the mean of demonstrations.

All motions have one row per step of the demonstration. Positions are any number of columns.
"""

import numpy as np

from pilotfish.geometry import angle


def resample_rows(x: np.ndarray, steps: int) -> np.ndarray:
    """Interpolate rows linearly over the same time."""
    before, wanted = np.linspace(0.0, 1.0, len(x)), np.linspace(0.0, 1.0, steps)
    return np.stack([np.interp(wanted, before, column) for column in x.T], axis=1)


def shift_ends(x: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Add the offsets that are missing at start and end; each fades out linearly over the motion."""
    share = np.linspace(0.0, 1.0, len(x))[:, None]
    return np.asarray(x + (1.0 - share) * (start - x[0]) + share * (end - x[-1]))


def mean_with_offsets(demonstrations: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the mean of demonstrations of the same length, moved to a start and an end."""
    return shift_ends(np.mean(demonstrations, axis=0), start, end)


def mean_distance(x: np.ndarray, y: np.ndarray) -> float:
    """Return the mean distance of the rows of two motions at the same time."""
    return float(np.linalg.norm(x - y, axis=1).mean())


def relative_size(x: np.ndarray, y: np.ndarray) -> float:
    """Return the root-mean-square distance of the rows of x from their mean, divided by that of y."""
    spreads = [float(np.sqrt(np.sum((z - z.mean(axis=0)) ** 2))) for z in (x, y)]
    return spreads[0] / spreads[1]


def extent(y: np.ndarray) -> float:
    """Return the diagonal of the box around the rows."""
    return float(np.linalg.norm(np.ptp(y, axis=0)))


def mean_angle(q: np.ndarray, p: np.ndarray) -> float:
    """Return the mean angle between orientations, unit quaternions of any sign [deg]."""
    return float(np.degrees(angle(q, p)).mean())
