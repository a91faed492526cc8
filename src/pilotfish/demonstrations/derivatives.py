"""Speeds beside places, as the recording's own differences."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.types import Array, Float


def with_derivatives(demo: Demonstration) -> Demonstration:
    """Each part and its rate of change v, such that x[t+1] = x[t] + period v[t]; the last v is repeated.

    Frames turn derivatives as they turn the parts and do not move them: A again on the new block, b zero.
    Raises: InvalidInput, when the layout has derivatives already.
    """
    layout = demo.layout.differentiated()
    slopes = np.diff(demo.x, axis=0) / demo.period
    x = np.hstack([demo.x, np.vstack([slopes, slopes[-1:]])])
    return demonstration(x, demo.period, layout, map(_extended, demo.frames), demo.name)


def _extended(given: Frame | MovingFrame) -> Frame | MovingFrame:
    if isinstance(given, MovingFrame):
        return MovingFrame(given.name, _twice(given.A), np.hstack([given.b, np.zeros_like(given.b)]))
    return Frame(given.name, _twice(given.A), np.concatenate([given.b, np.zeros_like(given.b)]))


def _twice(A: Float[Array, "*T D D"]) -> Float[Array, "*T E E"]:
    D = A.shape[-1]
    doubled = np.zeros((*A.shape[:-2], 2 * D, 2 * D))
    doubled[..., :D, :D] = A
    doubled[..., D:, D:] = A
    return doubled
