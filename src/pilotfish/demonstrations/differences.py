"""Forward differences of rows, on R^n and on S^3."""

import numpy as np

from pilotfish.geometry import log_map
from pilotfish.types import Array, Float


def forward_differences(values: Float[Array, "T *d"], period: float) -> Float[Array, "T *d"]:
    """Return the forward differences per second; the last one is repeated."""
    slopes = np.diff(values, axis=0) / period
    return np.concatenate([slopes, slopes[-1:]])


def tangent_differences(
    x: Float[Array, "T D"], orientation_starts: tuple[int, ...], period: float
) -> Float[Array, "T E"]:
    """Return the deviation of each row from the previous one per second; the last one is repeated."""
    slopes = log_map(x[:-1], x[1:], orientation_starts) / period
    return np.vstack([slopes, slopes[-1:]])
