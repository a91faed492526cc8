"""Plot of an adapted skill and its reproduction, in planes and in space."""

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
from pilotfish.planning import ViaPoint, ViaPointObservation, observe_via_points
from pilotfish.plots.ambient_covariances import ambient_covariances
from pilotfish.plots.ellipses import (
    FrameAxes,
    draw_ellipses,
    draw_frame_axes,
    draw_principal_axes,
    frame_axes_in,
    label_frame_axes,
    label_frame_axes_3d,
)
from pilotfish.plots.labels import place_labels
from pilotfish.plots.style import (
    DEMONSTRATION,
    MOTION,
    axis_label,
    legend_below,
    new_figure,
    state_legend_handles,
    style_axes,
)
from pilotfish.plots.validation import (
    Plane,
    plane_columns,
    position_columns,
    require_motion,
    require_same_columns,
    require_sequence,
    require_states,
    require_type,
    require_width,
)
from pilotfish.types import Array, Float, Int

SPACE_DIMENSIONS = 3
MAX_PATH_MARKS = 60  # points of the motion that labels avoid
MIN_RELATIVE_HEIGHT = 0.4  # of the longest side of the box in space
VIA_POINT_MARKER: dict[str, Any] = {
    "color": MOTION,
    "marker": "D",
    "markersize": 7,
    "markerfacecolor": "white",
    "markeredgewidth": 1.6,
    "linestyle": "",
}
START_MARKER: dict[str, Any] = {"color": MOTION, "marker": "o", "markersize": 6.5, "markeredgecolor": "white"}


def reproduction(
    skill: AdaptedSkill,
    motion: Motion,
    frames: Sequence[Frame],
    *,
    demonstration: Demonstration | None = None,
    planes: Sequence[Plane] | None = None,
    points: Sequence[ViaPoint] = (),
) -> Figure:
    """Plot adapted states and motion in each plane, and in space if the position has three axes.

    Args:
        skill: Adapted skill.
        motion: Reproduced motion.
        frames: Frames of the objects, drawn as axes.
        demonstration: Demonstration in the same situation, for comparison.
        planes: Pairs of column names; None for x-y and x-z of the first position.
        points: Via-points, drawn as diamonds in panels all of whose axes they have.

    Returns:
        The figure.

    Raises:
        InvalidInput: If columns differ, there are too many states, or a point is at no step of the motion.

    Source:
        After Tanwani 2018, figures 3.3 and 3.6.
    """
    _validate(skill, motion, frames, demonstration)
    require_sequence("points", points, ViaPoint)
    observations = observe_via_points(points, skill.layout, motion.x, motion.period)
    plane_indices, space = plane_columns(skill.layout, planes), position_columns(skill.layout)
    is_spatial = len(space) == SPACE_DIMENSIONS
    count = len(plane_indices) + is_spatial
    figure = new_figure(max(6.0, 4.2 * count), 4.8)
    cells = figure.add_gridspec(1, count, width_ratios=[1.0] * len(plane_indices) + [1.25] * is_spatial)
    length = 0.15 * float(np.ptp(motion.x[:, space], axis=0).max()) if space else 0.0
    drawn = []
    for n, plane in enumerate(plane_indices):
        panel = figure.add_subplot(cells[0, n])
        frame_axes = frame_axes_in(frames, space, plane, length) if set(plane) <= set(space) else []
        labels = _draw_plane(panel, skill, motion, demonstration, plane, frame_axes, length)
        _draw_via_points(panel, observations, plane)
        path = motion.x[_path_marks(len(motion.x))][:, list(plane)]
        drawn.append((panel, labels, np.vstack([path, *(origin for _, origin, _ in frame_axes)])))
    if is_spatial:
        frame_axes = frame_axes_in(frames, space, space, length)
        panel = figure.add_subplot(cells[0, -1], projection="3d")
        _draw_space(panel, skill, motion, demonstration, frame_axes)
        _draw_via_points(panel, observations, tuple(space))
    legend_below(
        figure, [*_path_handles(demonstration is not None, bool(points)), *state_legend_handles(skill.states)]
    )
    figure.draw_without_rendering()  # label positions are known afterwards
    for panel, labels, marks in drawn:
        place_labels(panel, labels, marks)
    return figure


def _validate(
    skill: AdaptedSkill, motion: Motion, frames: Sequence[Frame], demonstration: Demonstration | None
) -> None:
    require_type("skill", skill, AdaptedSkill)
    require_type("motion", motion, Motion)
    require_sequence("frames", frames, Frame)
    require_states(skill.states)
    require_motion(motion, skill.layout)
    for frame in frames:
        require_width(f"frame {frame.name!r}", len(frame.b), skill.layout)
    if demonstration is not None:
        require_same_columns(demonstration, skill.layout)


def _path_marks(steps: int) -> Int[Array, " M"]:
    """Return the steps of a motion that labels should not cover, the start among them."""
    return np.unique(np.linspace(0, steps - 1, min(steps, MAX_PATH_MARKS)).round().astype(int))


def _draw_via_points(
    panel: Axes | Axes3D, observations: Sequence[ViaPointObservation], axes: tuple[int, ...]
) -> None:
    """Draw via-points that have all axes of the panel."""
    for o in observations:
        values = dict(zip(o.columns.tolist(), o.values.tolist(), strict=True))
        if set(axes) <= set(values):
            panel.plot(*([values[column]] for column in axes), **VIA_POINT_MARKER, zorder=9)


def _draw_plane(
    panel: Axes,
    skill: AdaptedSkill,
    motion: Motion,
    demonstration: Demonstration | None,
    plane: tuple[int, int],
    frame_axes: Sequence[FrameAxes],
    length: float,
) -> list[Annotation]:
    """Draw frames, states and paths in a plane, and return the labels to be placed."""
    draw_frame_axes(panel, frame_axes)
    names = label_frame_axes(panel, frame_axes, length)
    panel.margins(0.1)  # for labels
    numbers = draw_ellipses(panel, skill.means, _covariances(skill), plane, "adapted")
    if demonstration is not None:
        panel.plot(*demonstration.x[:, plane].T, color=DEMONSTRATION, linestyle="--", linewidth=1.6, zorder=2)
    panel.plot(*motion.x[:, plane].T, color=MOTION, linewidth=1.8, zorder=2)
    panel.plot(*motion.x[0, list(plane)][:, None], **START_MARKER, zorder=7)
    x, y = (axis_label(skill.layout, column) for column in plane)
    style_axes(panel, x=x, y=y).set_aspect("equal", adjustable="datalim")
    return [*names, *numbers]


def _covariances(skill: AdaptedSkill) -> Float[Array, "K D D"]:
    return ambient_covariances(skill.means, skill.covariances, skill.layout)


def _draw_space(
    axes: Axes3D,
    skill: AdaptedSkill,
    motion: Motion,
    demonstration: Demonstration | None,
    frame_axes: Sequence[FrameAxes],
) -> None:
    space = position_columns(skill.layout)
    draw_principal_axes(axes, skill.means[:, space], _covariances(skill)[:, space][:, :, space])
    draw_frame_axes(axes, frame_axes)
    label_frame_axes_3d(axes, frame_axes)
    if demonstration is not None:
        axes.plot(*demonstration.x[:, space].T, color=DEMONSTRATION, linestyle="--", linewidth=1.6)
    axes.plot(*motion.x[:, space].T, color=MOTION, linewidth=1.8)
    axes.plot(*motion.x[0, space][:, None], **START_MARKER, zorder=7)
    for axis, column in zip((axes.xaxis, axes.yaxis, axes.zaxis), space, strict=True):
        axis.set_label_text(axis_label(skill.layout, column))
        axis.set_major_locator(MaxNLocator(4))
        axis.labelpad = 7.0
    _set_equal_aspect(axes)


def _set_equal_aspect(axes: Axes3D) -> None:
    """Use one scale in all directions; a flat box is made thick enough for its ticks."""
    limits = np.array([axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()])
    half = np.maximum(np.ptp(limits, axis=1), MIN_RELATIVE_HEIGHT * np.ptp(limits, axis=1).max()) / 2
    low, high = limits.mean(axis=1) - half, limits.mean(axis=1) + half
    axes.set(xlim3d=(low[0], high[0]), ylim3d=(low[1], high[1]), zlim3d=(low[2], high[2]))
    axes.set_box_aspect(half, zoom=0.84)  # for the labels, which layout engines ignore


def _path_handles(demonstration: bool, points: bool) -> list[Line2D]:
    handles = [
        Line2D([], [], color=MOTION, label="reproduction"),
        Line2D([], [], **START_MARKER, linestyle="", label="start"),
        *([Line2D([], [], **VIA_POINT_MARKER, label="via-point")] if points else []),
    ]
    reference = Line2D([], [], color=DEMONSTRATION, linestyle="--", label="demonstration")
    return [*handles, reference] if demonstration else handles
