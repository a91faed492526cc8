"""Speeds beside places, as the recording's own differences."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.types import Array, Float


def with_derivatives(demo: Demonstration) -> Demonstration:
    """Each part and its rate of change v, such that x[t+1] = x[t] + period v[t]; the last v is repeated.

    Frames that stand turn derivatives as they turn the parts and do not move them: A again on the new block,
    b zero. Frames that move carry things along: what is seen from them are the differences of what is seen.
    Raises: InvalidInput, when the layout has derivatives already.
    """
    layout = demo.layout.differentiated()
    slopes = np.diff(demo.x, axis=0) / demo.period
    x = np.hstack([demo.x, np.vstack([slopes, slopes[-1:]])])
    return demonstration(x, demo.period, layout, [_extended(f, demo.period) for f in demo.frames], demo.name)


def _extended(given: Frame | MovingFrame, period: float) -> Frame | MovingFrame:
    if isinstance(given, Frame):
        return Frame(given.name, np.kron(np.eye(2), given.A), np.append(given.b, np.zeros_like(given.b)))
    T, D = given.b.shape
    later = np.minimum(np.arange(T) + 1, T - 1)
    # x = A y + b, hence (x' - x) / h = A' (y' - y) / h + (A' - A) / h y + (b' - b) / h
    A = np.zeros((T, 2 * D, 2 * D))
    A[:, :D, :D], A[:, D:, D:], A[:, D:, :D] = given.A, given.A[later], _rates(given.A, period)
    return MovingFrame(given.name, A, np.hstack([given.b, _rates(given.b, period)]))


def _rates(values: Float[Array, "T *d"], period: float) -> Float[Array, "T *d"]:
    """Forward differences over time, the last repeated."""
    slopes = np.diff(values, axis=0) / period
    return np.concatenate([slopes, slopes[-1:]])
