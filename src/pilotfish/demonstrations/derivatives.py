"""Velocities of a recording, as forward differences."""

import numpy as np

from pilotfish.demonstrations.differences import tangent_differences
from pilotfish.demonstrations.recording import Demonstration, demonstration


def add_derivatives(demo: Demonstration) -> Demonstration:
    """Append the velocity v of each part to a demonstration, such that x[t+1] = x[t] + period v[t].

    The last velocity is repeated. The velocity of an orientation on S^3 is the angular velocity in body axes,
    x[t+1] = x[t] exp(period v[t] / 2). Frames are extended likewise; local velocities in a moving frame are
    the differences of local points.

    Args:
        demo: Demonstration without derivatives.

    Returns:
        A demonstration with the columns of `Layout.differentiate`.

    Raises:
        InvalidInput: If the layout has derivatives already.
    """
    layout = demo.layout.differentiate()
    slopes = tangent_differences(demo.x, demo.layout.orientation_starts, demo.period)
    frames = [frame.differentiate(demo.x, demo.layout, demo.period) for frame in demo.frames]
    return demonstration(np.hstack([demo.x, slopes]), demo.period, layout, frames, demo.name)
