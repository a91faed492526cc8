"""Points that a motion was asked to pass, and what it did about them."""

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
from pilotfish.plots.coordinates import panel_rows
from pilotfish.plots.kinds import require_sequence, require_type
from pilotfish.plots.style import DEMONSTRATION, MOTION, axis_label, legend_below, new_figure, style_axes
from pilotfish.plots.validation import column_indices, require_motion

VIA_POINT_COLOUR = "#D55E00"


def via_points(
    layout: Layout,
    motion: Motion,
    points: Sequence[ViaPoint],
    *,
    baseline: Motion | None = None,
    columns: Sequence[str] | None = None,
) -> Figure:
    """A panel for each column that points name: the motion over time, and the points with their deviations.

    without is the motion as it would have been, for comparison. columns are names; if not given, those that
    points name.
    Raises: InvalidInput, when widths or steps differ, a point is at no step of the motion, no columns are
    left or one is unknown.
    """
    require_type("layout", layout, Layout)
    require_type("motion", motion, Motion)
    require_sequence("points", points, ViaPoint)
    require_motion(motion, layout)
    if baseline is not None:
        require_type("baseline", baseline, Motion)
        if baseline.x.shape != motion.x.shape:
            raise InvalidInput(
                f"the motion without points has the shape {baseline.x.shape}, expected {motion.x.shape}"
            )
    observed = observe_via_points(points, layout, motion.x, motion.period)
    named = sorted({int(c) for o in observed for c in o.columns})
    rows = panel_rows(layout, named if columns is None else column_indices(layout, columns))
    if not rows:
        raise InvalidInput("there are no points, so no columns that they name; name columns to draw")
    most = max(map(len, rows))
    figure = new_figure(max(5.0, 3.2 * most), 2.4 * len(rows) + 0.8)
    cells = figure.add_gridspec(len(rows), most)
    for r, row in enumerate(rows):
        for c, column in enumerate(row):
            panel = style_axes(figure.add_subplot(cells[r, c]), x="time [s]", y=axis_label(layout, column))
            _draw(panel, motion, baseline, observed, column)
    legend_below(figure, _handles(baseline is not None))
    return figure


def _draw(
    panel: Axes, motion: Motion, baseline: Motion | None, observed: Sequence[ViaPointObservation], column: int
) -> None:
    seconds = motion.period * np.arange(len(motion.x))
    if baseline is not None:
        panel.plot(seconds, baseline.x[:, column], color=DEMONSTRATION, linestyle="--", linewidth=1.6)
    panel.plot(seconds, motion.x[:, column], color=MOTION, linewidth=1.6)
    for o in observed:
        for c, value, deviation in zip(o.columns, o.values, o.deviations, strict=True):
            if c == column:
                when = motion.period * o.step
                panel.errorbar(
                    when,
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
            [], [], color=VIA_POINT_COLOUR, marker="o", linestyle="", label="point to pass, and its deviation"
        ),
    ]
    dashed = Line2D([], [], color=DEMONSTRATION, linestyle="--", label="motion without points")
    return [*handles, dashed] if baseline else handles
