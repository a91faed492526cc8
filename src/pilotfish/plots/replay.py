"""A skill in the situation at hand, and the motion that came of it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.axes3d import Axes3D

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill
from pilotfish.plots.doors import (
    Plane,
    chosen_planes,
    position_columns,
    require_human,
    require_motion,
    require_states,
    require_width,
)
from pilotfish.plots.ellipses import draw_crosses, draw_ellipses, draw_triads, name_triads
from pilotfish.plots.style import AXIS_COLOURS, HUMAN, MOTION, dress, legend_below, sheet, state_handles, with_unit
from pilotfish.types import Array, Float

SPACE = 3


def reproduction(
    skill: AdaptedSkill,
    motion: Motion,
    frames: Sequence[Frame],
    *,
    human: Demonstration | None = None,
    planes: Sequence[Plane] | None = None,
) -> Figure:
    """The adapted states and the motion in each plane, and in space when the position has three axes.

    Frames stand as triads of axes. human is what a person did in the same situation, for comparison.
    Raises: InvalidInput, when widths differ or states are too many.
    Source: after Tanwani 2018, figures 3.3 and 3.6.
    """
    require_states(skill.states)
    require_motion(motion, skill.layout)
    for frame in frames:
        require_width(f"frame {frame.name!r}", len(frame.b), skill.layout)
    if human is not None:
        require_human(human, skill.layout)
    chosen, space = chosen_planes(skill.layout, planes), position_columns(skill.layout)
    solid = len(space) == SPACE
    count = len(chosen) + solid
    figure = sheet(max(6.0, 4.2 * count), 4.8)
    length = 0.25 * float(np.ptp(motion.x[:, space], axis=0).max()) if space else 0.0
    for n, plane in enumerate(chosen):
        panel = figure.add_subplot(1, count, n + 1)
        _draw_plane(panel, skill, motion, human, plane)
        if set(plane) <= set(space):
            draw_triads(panel, frames, space, plane, length)
            name_triads(panel, frames, plane)
    if solid:
        _draw_space(figure.add_subplot(1, count, count, projection="3d"), skill, motion, human, frames, length)
    legend_below(figure, [*_path_handles(human is not None, bool(space)), *state_handles(skill.states)])
    return figure
