"""Speeds beside places, as the recording's own differences."""

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame, euclidean_columns, tangent_map
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.geometry import log_map
from pilotfish.types import Array, Float


def add_derivatives(demo: Demonstration) -> Demonstration:
    """Each part and its rate of change v, such that x[t+1] = x[t] + period v[t]; the last v is repeated.

    Of an orientation on S^3 it is the angular velocity in body axes, x[t+1] = x[t] exp(period v[t] / 2).
    Frames that stand turn derivatives as they turn the parts and do not move them: A again on the new block,
    b zero. Frames that move carry things along: what is seen from them are the differences of what is seen.
    Raises: InvalidInput, when the layout has derivatives already.
    """
    layout = demo.layout.differentiate()
    slopes = _tangent_differences(demo.x, demo.layout.orientation_starts, demo.period)
    frames = [
        _differentiate_frame(f, demo)
        if isinstance(f, Frame)
        else _differentiate_moving_frame(f, demo, slopes)
        for f in demo.frames
    ]
    return demonstration(np.hstack([demo.x, slopes]), demo.period, layout, frames, demo.name)


def _tangent_differences(
    x: Float[Array, "T D"], orientation_starts: tuple[int, ...], period: float
) -> Float[Array, "T E"]:
    """Deviations of each row from the one before, per second; the last repeated."""
    slopes = log_map(x[:-1], x[1:], orientation_starts) / period
    return np.vstack([slopes, slopes[-1:]])


def _differentiate_frame(given: Frame, demo: Demonstration) -> Frame:
    D, carried = len(given.b), tangent_map(given.A, demo.layout.orientation_starts)
    A = np.zeros((D + len(carried),) * 2)
    A[:D, :D], A[D:, D:] = given.A, carried
    return Frame(given.name, A, np.append(given.b, np.zeros(len(carried))))


def _differentiate_moving_frame(
    given: MovingFrame, demo: Demonstration, slopes: Float[Array, "T E"]
) -> MovingFrame:
    T, D = given.b.shape
    next_row, (flat, tangents) = (
        np.minimum(np.arange(T) + 1, T - 1),
        euclidean_columns(D, demo.layout.orientation_starts),
    )
    # x = A y + b, hence (x' - x) / h = A' (y' - y) / h + (A' - A) / h y + (b' - b) / h
    A = np.zeros((T, D + slopes.shape[1], D + slopes.shape[1]))
    A[:, :D, :D], A[:, D:, D:] = given.A, tangent_map(given.A[next_row], demo.layout.orientation_starts)
    A[:, D + tangents[:, None], flat] = _forward_differences(given.A, demo.period)[:, flat[:, None], flat]
    # Of a turn, the angular velocity seen and the one in the world differ by that of the frame in body axes.
    local = np.linalg.solve(given.A, (demo.x - given.b)[..., None])[..., 0]
    b = slopes - _tangent_differences(local, demo.layout.orientation_starts, demo.period)
    b[:, tangents] = _forward_differences(given.b, demo.period)[:, flat]
    return MovingFrame(given.name, A, np.hstack([given.b, b]))


def _forward_differences(values: Float[Array, "T *d"], period: float) -> Float[Array, "T *d"]:
    """Forward differences over time, the last repeated."""
    slopes = np.diff(values, axis=0) / period
    return np.concatenate([slopes, slopes[-1:]])
