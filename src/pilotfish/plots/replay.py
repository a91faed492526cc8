"""A skill in the situation at hand, and the motion that came of it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped] # matplotlib types no 3-D axes

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.models import AdaptedSkill
from pilotfish.planning import Observation, ViaPoint, observations
from pilotfish.plots.doors import (
    Plane,
    chosen_planes,
    position_columns,
    require_human,
    require_motion,
    require_states,
    require_width,
)
from pilotfish.plots.ellipses import (
    Triad,
    draw_crosses,
    draw_ellipses,
    draw_triads,
    label_triads,
    letter_in_space,
    triads_of,
)
from pilotfish.plots.kinds import require_kind, require_list
from pilotfish.plots.labels import settle
from pilotfish.plots.spreads import in_columns
from pilotfish.plots.style import (
    HUMAN,
    MOTION,
    dress,
    legend_below,
    sheet,
    state_handles,
    with_unit,
)
from pilotfish.types import Array, Float

SPACE = 3
THINNEST = 0.4  # of the longest side of the box in space
DIAMOND: dict[str, Any] = {
    "color": MOTION,
    "marker": "D",
    "markersize": 7,
    "markerfacecolor": "white",
    "markeredgewidth": 1.6,
    "linestyle": "",
}
BEGINNING: dict[str, Any] = {"color": MOTION, "marker": "o", "markersize": 6.5, "markeredgecolor": "white"}


def reproduction(
    skill: AdaptedSkill,
    motion: Motion,
    frames: Sequence[Frame],
    *,
    human: Demonstration | None = None,
    planes: Sequence[Plane] | None = None,
    points: Sequence[ViaPoint] = (),
) -> Figure:
    """The adapted states and the motion in each plane, and in space when the position has three axes.

    Frames stand as triads of axes. human is what was shown in the same situation, for comparison. points are
    via-points: diamonds where they name all axes of a panel.
    Raises: InvalidInput, when widths differ, states are too many or a point is at no step of the motion.
    Source: after Tanwani 2018, figures 3.3 and 3.6.
    """
    _require(skill, motion, frames, human)
    require_list("points", points, ViaPoint)
    seen = observations(points, skill.layout, motion.x, motion.period)
    chosen, space = chosen_planes(skill.layout, planes), position_columns(skill.layout)
    solid = len(space) == SPACE
    count = len(chosen) + solid
    figure = sheet(max(6.0, 4.2 * count), 4.8)
    cells = figure.add_gridspec(1, count, width_ratios=[1.0] * len(chosen) + [1.25] * solid)
    length = 0.15 * float(np.ptp(motion.x[:, space], axis=0).max()) if space else 0.0
    drawn = []
    for n, plane in enumerate(chosen):
        panel = figure.add_subplot(cells[0, n])
        triads = triads_of(frames, space, plane, length) if set(plane) <= set(space) else []
        draw_triads(panel, triads)
        labels = [*label_triads(panel, triads, length), *_draw_plane(panel, skill, motion, human, plane)]
        _draw_diamonds(panel, seen, plane)
        drawn.append((panel, labels, np.stack([motion.x[0, list(plane)], *(t.origin for t in triads)])))
    if solid:
        triads = triads_of(frames, space, space, length)
        panel = figure.add_subplot(cells[0, -1], projection="3d")
        _draw_space(panel, skill, motion, human, triads)
        _draw_diamonds(panel, seen, tuple(space))
    legend_below(figure, [*_path_handles(human is not None, bool(points)), *state_handles(skill.states)])
    figure.draw_without_rendering()  # only then is known where labels stand
    for panel, labels, marks in drawn:
        settle(panel, labels, marks)
    return figure


def _require(
    skill: AdaptedSkill, motion: Motion, frames: Sequence[Frame], human: Demonstration | None
) -> None:
    require_kind("skill", skill, AdaptedSkill)
    require_kind("motion", motion, Motion)
    require_list("frames", frames, Frame)
    require_states(skill.states)
    require_motion(motion, skill.layout)
    for frame in frames:
        require_width(f"frame {frame.name!r}", len(frame.b), skill.layout)
    if human is not None:
        require_human(human, skill.layout)


def _draw_diamonds(panel: Axes | Axes3D, seen: Sequence[Observation], axes: tuple[int, ...]) -> None:
    """Where the motion was asked to pass, by points that name all axes of the panel."""
    for o in seen:
        wished = dict(zip(o.columns.tolist(), o.values.tolist(), strict=True))
        if set(axes) <= set(wished):
            panel.plot(*([wished[column]] for column in axes), **DIAMOND, zorder=9)


def _draw_plane(
    panel: Axes, skill: AdaptedSkill, motion: Motion, human: Demonstration | None, plane: tuple[int, int]
) -> list[Annotation]:
    """All but the frames; the numbers of states are returned, to be settled."""
    panel.margins(0.1)  # room for labels
    numbers = draw_ellipses(panel, skill.means, _covariances(skill), plane, "adapted")
    if human is not None:
        panel.plot(*human.x[:, plane].T, color=HUMAN, linestyle="--", linewidth=1.6, zorder=2)
    panel.plot(*motion.x[:, plane].T, color=MOTION, linewidth=1.8, zorder=2)
    panel.plot(*motion.x[0, list(plane)][:, None], **BEGINNING, zorder=7)
    x, y = (with_unit(skill.layout, column) for column in plane)
    dress(panel, x=x, y=y).set_aspect("equal", adjustable="datalim")
    return numbers


def _covariances(skill: AdaptedSkill) -> Float[Array, "K D D"]:
    return in_columns(skill.means, skill.covariances, skill.layout)


def _draw_space(
    axes: Axes3D,
    skill: AdaptedSkill,
    motion: Motion,
    human: Demonstration | None,
    triads: Sequence[Triad],
) -> None:
    space = position_columns(skill.layout)
    draw_crosses(axes, skill.means[:, space], _covariances(skill)[:, space][:, :, space])
    draw_triads(axes, triads)
    letter_in_space(axes, triads)
    if human is not None:
        axes.plot(*human.x[:, space].T, color=HUMAN, linestyle="--", linewidth=1.6)
    axes.plot(*motion.x[:, space].T, color=MOTION, linewidth=1.8)
    axes.plot(*motion.x[0, space][:, None], **BEGINNING, zorder=7)
    for axis, column in zip((axes.xaxis, axes.yaxis, axes.zaxis), space, strict=True):
        axis.set_label_text(with_unit(skill.layout, column))
        axis.set_major_locator(MaxNLocator(4))
        axis.labelpad = 7.0
    _scale_equally(axes)


def _scale_equally(axes: Axes3D) -> None:
    """A metre is as long in every direction; a flat box is made thick enough for its ticks."""
    limits = np.array([axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()])
    half = np.maximum(np.ptp(limits, axis=1), THINNEST * np.ptp(limits, axis=1).max()) / 2
    low, high = limits.mean(axis=1) - half, limits.mean(axis=1) + half
    axes.set(xlim3d=(low[0], high[0]), ylim3d=(low[1], high[1]), zlim3d=(low[2], high[2]))
    axes.set_box_aspect(half, zoom=0.84)  # room for the labels, which no layout engine knows of


def _path_handles(human: bool, points: bool) -> list[Line2D]:
    handles = [
        Line2D([], [], color=MOTION, label="reproduction"),
        Line2D([], [], **BEGINNING, linestyle="", label="its beginning"),
        *([Line2D([], [], **DIAMOND, label="point to pass")] if points else []),
    ]
    shown = Line2D([], [], color=HUMAN, linestyle="--", label="demonstration")
    return [*handles, shown] if human else handles
