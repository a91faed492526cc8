"""A skill in the situation at hand, and the motion that came of it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped] # matplotlib types no 3-D axes

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Frame
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
from pilotfish.plots.style import (
    HUMAN,
    MOTION,
    dress,
    legend_below,
    sheet,
    state_handles,
    with_unit,
)

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

    Frames stand as triads of axes. human is what was shown in the same situation, for comparison.
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
    cells = figure.add_gridspec(1, count, width_ratios=[1.0] * len(chosen) + [1.25] * solid)
    length = 0.15 * float(np.ptp(motion.x[:, space], axis=0).max()) if space else 0.0
    for n, plane in enumerate(chosen):
        panel = figure.add_subplot(cells[0, n])
        _draw_plane(panel, skill, motion, human, plane)
        if set(plane) <= set(space):
            draw_triads(panel, frames, space, plane, length)
            name_triads(panel, frames, plane)
    if solid:
        _draw_space(figure.add_subplot(cells[0, -1], projection="3d"), skill, motion, human, frames, length)
    legend_below(figure, [*_path_handles(human is not None), *state_handles(skill.states)])
    return figure


def _draw_plane(
    panel: Axes, skill: AdaptedSkill, motion: Motion, human: Demonstration | None, plane: tuple[int, int]
) -> None:
    draw_ellipses(panel, skill.means, skill.covariances, plane, "adapted")
    if human is not None:
        panel.plot(*human.x[:, plane].T, color=HUMAN, linestyle="--", linewidth=1.6, zorder=2)
    panel.plot(*motion.x[:, plane].T, color=MOTION, linewidth=1.8, zorder=2)
    panel.plot(*motion.x[0, list(plane)][:, None], color=MOTION, marker="o", markersize=5, zorder=4)
    x, y = (with_unit(skill.layout, column) for column in plane)
    dress(panel, x=x, y=y).set_aspect("equal", adjustable="datalim")


def _draw_space(
    axes: Axes3D,
    skill: AdaptedSkill,
    motion: Motion,
    human: Demonstration | None,
    frames: Sequence[Frame],
    length: float,
) -> None:
    space = position_columns(skill.layout)
    draw_crosses(axes, skill.means[:, space], skill.covariances[:, space][:, :, space])
    draw_triads(axes, frames, space, space, length)
    if human is not None:
        axes.plot(*human.x[:, space].T, color=HUMAN, linestyle="--", linewidth=1.6)
    axes.plot(*motion.x[:, space].T, color=MOTION, linewidth=1.8)
    for axis, column in zip((axes.xaxis, axes.yaxis, axes.zaxis), space, strict=True):
        axis.set_label_text(with_unit(skill.layout, column))
        axis.set_major_locator(MaxNLocator(4))
        axis.labelpad = 7.0
    axes.set_aspect("equal")
    axes.set_box_aspect(None, zoom=0.84)  # room for the labels, which no layout engine knows of


def _path_handles(human: bool) -> list[Line2D]:
    handles = [
        Line2D([], [], color=MOTION, label="reproduction"),
        Line2D([], [], color=MOTION, marker="o", markersize=5, linestyle="", label="its beginning"),
    ]
    shown = Line2D([], [], color=HUMAN, linestyle="--", label="demonstration")
    return [*handles, shown] if human else handles
