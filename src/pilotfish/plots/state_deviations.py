"""Plot of the standard deviations of states in each frame."""

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.models import Skill
from pilotfish.plots.style import (
    FIGURE_WIDTH,
    column_colour,
    column_dash,
    legend_below,
    new_figure,
    style_axes,
)
from pilotfish.plots.validation import column_indices, require_states, require_type
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array

HIGHLIGHT = "#CFE3F5"
MARKERS = ("o", "s", "^", "D", "v")
FLOOR_COLOUR, FLOOR_DASH, FLOOR_LABEL = "0.35", (0, (6, 3)), "floor set by regularisation"
MAX_TICKS = 15
MAX_LEGEND_ENTRIES = 24  # columns; of more, the legend would cover the plot
ONE_DECADE, MANY_DECADES = 0.8, 3.0  # below the first, linear ticks


def state_deviations(
    skill: Skill, *, columns: Sequence[str] | None = None, floor: Float[Array, " E"] | None = None
) -> Figure:
    """Plot the standard deviation of each state in each frame, column by column, on a logarithmic scale.

    Columns of one unit share a panel. The state with the smallest product of deviations in a panel is shaded.
    A dashed line is the floor that regularisation sets: a deviation near it was not learned.
    An orientation on S^3 deviates by a rotation vector in body axes: "orientation 1", 2 and 3 [rad].

    Args:
        skill: Learned skill.
        columns: Names of columns of the tangent layout; None for all that are not derivatives.
        floor: Smallest deviation of each column of the tangent layout; None for the square root of the
            skill's regularisation, if it has one.

    Returns:
        The figure.

    Raises:
        InvalidInput: If a column is unknown, there are too many states, or floor is not a deviation for each
            column.

    Source:
        After Tanwani 2018, figure 3.7.
    """
    require_type("skill", skill, Skill)
    require_states(skill.states)
    layout = skill.layout.tangent
    groups = _group_by_unit(layout, column_indices(layout, columns))
    floors = _require_floor(floor, skill)
    rows = len(skill.frame_names)
    figure = new_figure(max(5.5, 0.5 * FIGURE_WIDTH * len(groups)), 2.7 * rows + 0.6)
    panels = figure.subplots(rows, len(groups), squeeze=False, sharex=True, sharey="col")
    for p, name in enumerate(skill.frame_names):
        variances = np.diagonal(skill.covariances[p].dense, axis1=1, axis2=2)  # (K, D)
        for g, (panel, group) in enumerate(zip(panels[p], groups, strict=True)):
            names = [layout.names[c] for c in group]
            _draw_deviations(panel, np.sqrt(variances[:, group]), names, _marker(g))
            _draw_floor(panel, floors[group], names)
            unit = layout.units[group[0]]
            style_axes(panel, x="state", y=f"deviation [{unit}]", title=f"frame {name!r}")
            panel.tick_params(labelleft=True, labelbottom=True)
    for panel in panels[0]:  # the panels of a column share their scale
        _set_ticks(panel)
    legend_below(figure, _handles(layout, groups, has_floor=bool((floors > 0.0).any())))
    return figure


def _require_floor(floor: Float[Array, " E"] | None, skill: Skill) -> Float[Array, " E"]:
    """Return the smallest deviation of each column, 0 where there is none."""
    width = skill.layout.tangent.width
    if floor is None:
        return np.zeros(width) if skill.regularisation is None else np.sqrt(skill.regularisation)
    floors = finite_array(floor, "floor", (width,))
    if (floors < 0.0).any():
        raise InvalidInput(f"floor has the entry {floors.min():g}, expected deviations of at least 0")
    return floors


def _marker(group: int) -> str:
    """Return the marker of the columns of a panel: colours repeat between panels."""
    return MARKERS[group % len(MARKERS)]


def _draw_floor(panel: Axes, floors: Float[Array, " C"], names: Sequence[str]) -> None:
    """Draw the floor of all columns of a panel, or one for each column in its colour if they differ."""
    if np.ptp(floors) == 0.0:
        floors, names = floors[:1], ()
    for i, floor in enumerate(floors.tolist()):
        if floor > 0.0:
            colour = column_colour(names[i], i) if names else FLOOR_COLOUR
            panel.axhline(floor, color=colour, linestyle=FLOOR_DASH, linewidth=1.3, zorder=1, gid="floor")


def _group_by_unit(layout: Layout, columns: list[int]) -> list[list[int]]:
    """Group columns by unit, in order of appearance."""
    units = list(dict.fromkeys(layout.units[column] for column in columns))
    return [[column for column in columns if layout.units[column] == unit] for unit in units]


def _draw_deviations(panel: Axes, deviations: Float[Array, "K C"], names: Sequence[str], marker: str) -> None:
    states = np.arange(len(deviations))
    precise = int(np.log(deviations).sum(axis=1).argmin())
    panel.axvspan(precise - 0.5, precise + 0.5, color=HIGHLIGHT, zorder=0, gid="most precise")
    for i, name in enumerate(names):
        colour, dash = column_colour(name, i), column_dash(name, i)
        panel.plot(
            states, deviations[:, i], color=colour, linestyle=dash, marker=marker, markersize=5, linewidth=1.4
        )
    panel.set_yscale("log")
    panel.set_xticks(states[:: ceil(len(states) / MAX_TICKS)])
    panel.set_xlim(-0.5, len(deviations) - 0.5)


def _set_ticks(panel: Axes) -> None:
    """Use plain tick labels at round values, or powers of ten if the scale spans several decades."""
    low, high = panel.get_ylim()
    if (decades := np.log10(high / low)) >= MANY_DECADES:
        return
    panel.yaxis.set_major_locator(
        MaxNLocator(4) if decades < ONE_DECADE else LogLocator(subs=(1.0, 2.0, 5.0))
    )
    panel.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    panel.yaxis.set_minor_formatter(NullFormatter())


def _handles(layout: Layout, groups: list[list[int]], *, has_floor: bool) -> list[Line2D | Patch]:
    markers = {c: _marker(g) for g, group in enumerate(groups) for c in group}
    indices = [(i, c) for group in groups for i, c in enumerate(group)]
    colours = {c: column_colour(layout.names[c], i) for i, c in indices}
    dashes = {c: column_dash(layout.names[c], i) for i, c in indices}
    labels = {c: layout.names[c] for _, c in indices}
    if len(labels) > MAX_LEGEND_ENTRIES:
        labels = _unique_labels(labels, colours)
    lines = [
        Line2D([], [], color=colours[c], linestyle=dashes[c], marker=markers[c], markersize=5, label=label)
        for c, label in labels.items()
    ]
    floor = [Line2D([], [], color=FLOOR_COLOUR, linestyle=FLOOR_DASH, label=FLOOR_LABEL)] if has_floor else []
    return [*lines, *floor, Patch(color=HIGHLIGHT, label="most precise state")]


def _unique_labels(labels: dict[int, str], colours: dict[int, str]) -> dict[int, str]:
    """Return one column per colour, labelled with its name and how many others share the colour."""
    unique: dict[int, str] = {}
    for colour in dict.fromkeys(colours.values()):
        same = [c for c in labels if colours[c] == colour]
        more = f" and {len(same) - 1} more" if len(same) > 1 else ""
        unique[same[0]] = labels[same[0]] + more
    return unique
