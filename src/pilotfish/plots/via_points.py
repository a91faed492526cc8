"""Plot of a motion and its via-points over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pilotfish.control import Motion
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.planning import ViaPoint, ViaPointObservation, observe_via_points
from pilotfish.plots.style import DEMONSTRATION, MOTION, axis_label, legend_below, new_figure, style_axes
from pilotfish.plots.tracked_coordinates import panel_rows
from pilotfish.plots.validation import column_indices, require_motion, require_sequence, require_type

VIA_POINT_COLOUR = "#D55E00"


def via_points(
    layout: Layout,
    motion: Motion,
    points: Sequence[ViaPoint],
    *,
    baseline: Motion | None = None,
    columns: Sequence[str] | None = None,
) -> Figure:
    """Plot a motion over time and its via-points with their standard deviations, a panel per column.

    Args:
        layout: Columns of the motion.
        motion: Motion.
        points: Via-points.
        baseline: Motion without via-points, for comparison.
        columns: Names of columns; None for those of the via-points.

    Returns:
        The figure.

    Raises:
        InvalidInput: If columns or numbers of steps differ, a point is at no step of the motion, or a
            column is unknown.
    """
    require_type("layout", layout, Layout)
    require_type("motion", motion, Motion)
    require_sequence("points", points, ViaPoint)
    require_motion(motion, layout)
    if baseline is not None:
        require_type("baseline", baseline, Motion)
        if baseline.x.shape != motion.x.shape:
            raise InvalidInput(
                f"baseline has shape {baseline.x.shape}, expected {motion.x.shape} as the motion"
            )
    observations = observe_via_points(points, layout, motion.x, motion.period)
    point_columns = sorted({int(c) for observation in observations for c in observation.columns})
    rows = panel_rows(layout, point_columns if columns is None else column_indices(layout, columns))
    if not rows:
        raise InvalidInput("points is empty, expected at least one; or pass columns to draw")
    width = max(map(len, rows))
    figure = new_figure(max(5.0, 3.2 * width), 2.4 * len(rows) + 0.8)
    cells = figure.add_gridspec(len(rows), width)
    for r, row in enumerate(rows):
        for c, column in enumerate(row):
            panel = style_axes(figure.add_subplot(cells[r, c]), x="time [s]", y=axis_label(layout, column))
            _draw(panel, motion, baseline, observations, column)
    legend_below(figure, _handles(baseline is not None))
    return figure


def _draw(
    panel: Axes,
    motion: Motion,
    baseline: Motion | None,
    observations: Sequence[ViaPointObservation],
    column: int,
) -> None:
    seconds = motion.period * np.arange(len(motion.x))
    if baseline is not None:
        panel.plot(seconds, baseline.x[:, column], color=DEMONSTRATION, linestyle="--", linewidth=1.6)
    panel.plot(seconds, motion.x[:, column], color=MOTION, linewidth=1.6)
    for observation in observations:
        for c, value, deviation in zip(
            observation.columns, observation.values, observation.deviations, strict=True
        ):
            if c == column:
                time = motion.period * observation.step
                panel.errorbar(
                    time,
                    value,
                    deviation,
                    color=VIA_POINT_COLOUR,
                    marker="o",
                    markersize=5,
                    capsize=4,
                    zorder=5,
                )


def _handles(baseline: bool) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=MOTION, label="motion"),
        Line2D(
            [],
            [],
            color=VIA_POINT_COLOUR,
            marker="o",
            linestyle="",
            label="via-point and its deviation",
        ),
    ]
    dashed = Line2D([], [], color=DEMONSTRATION, linestyle="--", label="motion without via-points")
    return [*handles, dashed] if baseline else handles
