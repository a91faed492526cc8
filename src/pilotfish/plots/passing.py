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
from pilotfish.planning import Observation, ViaPoint, observations
from pilotfish.plots.coordinates import column_rows
from pilotfish.plots.doors import chosen_columns, require_motion
from pilotfish.plots.kinds import require_kind, require_list
from pilotfish.plots.style import HUMAN, MOTION, dress, legend_below, sheet, with_unit

WISH = "#D55E00"


def via_points(
    layout: Layout,
    motion: Motion,
    points: Sequence[ViaPoint],
    *,
    without: Motion | None = None,
    columns: Sequence[str] | None = None,
) -> Figure:
    """A panel for each column that points name: the motion over time, and the points with their deviations.

    without is the motion as it would have been, for comparison. columns are names; if not given, those that
    points name.
    Raises: InvalidInput, when widths or steps differ, a point is at no step of the motion, no columns are
    left or one is unknown.
    """
    require_kind("layout", layout, Layout)
    require_kind("motion", motion, Motion)
    require_list("points", points, ViaPoint)
    require_motion(motion, layout)
    if without is not None:
        require_kind("without", without, Motion)
        if without.x.shape != motion.x.shape:
            raise InvalidInput(
                f"the motion without points has the shape {without.x.shape}, expected {motion.x.shape}"
            )
    seen = observations(points, layout, motion.x, motion.period)
    named = sorted({int(c) for o in seen for c in o.columns})
    rows = column_rows(layout, named if columns is None else chosen_columns(layout, columns))
    if not rows:
        raise InvalidInput("there are no points, so no columns that they name; name columns to draw")
    most = max(map(len, rows))
    figure = sheet(max(5.0, 3.2 * most), 2.4 * len(rows) + 0.8)
    cells = figure.add_gridspec(len(rows), most)
    for r, row in enumerate(rows):
        for c, column in enumerate(row):
            panel = dress(figure.add_subplot(cells[r, c]), x="time [s]", y=with_unit(layout, column))
            _draw(panel, motion, without, seen, column)
    legend_below(figure, _handles(without is not None))
    return figure


def _draw(
    panel: Axes, motion: Motion, without: Motion | None, seen: Sequence[Observation], column: int
) -> None:
    seconds = motion.period * np.arange(len(motion.x))
    if without is not None:
        panel.plot(seconds, without.x[:, column], color=HUMAN, linestyle="--", linewidth=1.6)
    panel.plot(seconds, motion.x[:, column], color=MOTION, linewidth=1.6)
    for o in seen:
        for c, value, deviation in zip(o.columns, o.values, o.deviations, strict=True):
            if c == column:
                when = motion.period * o.step
                panel.errorbar(
                    when, value, deviation, color=WISH, marker="o", markersize=5, capsize=4, zorder=5
                )


def _handles(without: bool) -> list[Artist]:
    handles: list[Artist] = [
        Line2D([], [], color=MOTION, label="motion"),
        Line2D([], [], color=WISH, marker="o", linestyle="", label="point to pass, and its deviation"),
    ]
    dashed = Line2D([], [], color=HUMAN, linestyle="--", label="motion without points")
    return [*handles, dashed] if without else handles
