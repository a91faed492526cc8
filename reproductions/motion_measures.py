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


def time_warped_distance(x: np.ndarray, y: np.ndarray) -> float:
    """Return the mean distance of rows that dynamic time warping pairs.

    Warping chooses the monotone sequence of pairs, from the first rows to the last rows, with the least sum
    of distances. Each step advances one row in x, in y, or in both. The mean is over the pairs in it.

    Source:
        Sakoe & Chiba 1978, IEEE Transactions on Acoustics, Speech, and Signal Processing 26(1).
    """
    N, M = len(x), len(y)
    distances = np.linalg.norm(x[:, None] - y[None], axis=2)
    total = np.full((N + 1, M + 1), np.inf)
    pairs = np.zeros((N + 1, M + 1))
    total[0, 0] = 0.0
    for diagonal in range(2, N + M + 1):  # pairs of one anti-diagonal do not depend on each other
        i = np.arange(max(1, diagonal - M), min(N, diagonal - 1) + 1)
        j = diagonal - i
        rows, columns = np.stack([i - 1, i - 1, i]), np.stack([j - 1, j, j - 1])
        best = np.argmin(total[rows, columns], axis=0)
        before = rows[best, np.arange(len(i))], columns[best, np.arange(len(i))]
        total[i, j] = distances[i - 1, j - 1] + total[before]
        pairs[i, j] = 1.0 + pairs[before]
    return float(total[N, M] / pairs[N, M])


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
