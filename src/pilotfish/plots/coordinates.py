"""Coordinates over time: what the skill asked for, what the tracker did, and what was shown."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Layout
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, state_segments
from pilotfish.plots.kinds import require_array, require_type
from pilotfish.plots.spreads import ambient_covariances
from pilotfish.plots.style import (
    DEMONSTRATION,
    MOTION,
    axis_label,
    legend_below,
    new_figure,
    state_colour,
    state_legend_handles,
    style_axes,
)
from pilotfish.plots.validation import (
    column_indices,
    require_motion,
    require_period,
    require_same_columns,
    require_states,
)
from pilotfish.types import Array, Int

MAX_PANELS_PER_ROW = 4


def tracked_coordinates(
    skill: AdaptedSkill,
    states: Int[Array, " T"],
    motion: Motion,
    *,
    demonstration: Demonstration | None = None,
    columns: Sequence[str] | None = None,
) -> Figure:
    """A panel for each column: the planned states' means with bands of one deviation, and the motion on top.

    states is the planned sequence, one a step of the motion. Bands are the model's, without the slack that a
    plan adds: a wide band is where the tracker may yield. columns are names; all that are no derivatives if
    not given.
    Raises: InvalidInput, when lengths, widths or periods differ, or a state or column is unknown.
    """
    require_type("skill", skill, AdaptedSkill)
    require_type("motion", motion, Motion)
    require_array("states", states, "T", np.integer, "pilotfish.planning.planned_states makes one")
    require_states(skill.states)
    require_motion(motion, skill.layout)
    require_period("the motion", motion.period, skill.period)
    if demonstration is not None:
        require_same_columns(demonstration, skill.layout)
        require_period(f"demonstration {demonstration.name!r}", demonstration.period, skill.period)
    _require_planned_states(states, skill.states, len(motion.x))
    rows = panel_rows(skill.layout, column_indices(skill.layout, columns))
    most = max(map(len, rows))
    figure = new_figure(max(5.0, 3.2 * most), 2.4 * len(rows) + 0.8)
    cells = figure.add_gridspec(len(rows), most)
    for r, row in enumerate(rows):
        for c, column in enumerate(row):
            panel = style_axes(
                figure.add_subplot(cells[r, c]), x="time [s]", y=axis_label(skill.layout, column)
            )
            _draw_bands(panel, skill, states, column)
            _draw_lines(panel, motion, demonstration, column)
    legend_below(figure, _handles(demonstration is not None, skill.states))
    return figure


def _require_planned_states(states: Int[Array, " T"], known: int, steps: int) -> None:
    if len(states) != steps:
        raise InvalidInput(
            f"{len(states)} states were planned, expected {steps}: one for each step of the motion"
        )
    if states.min() < 0 or states.max() >= known:
        raise InvalidInput(
            f"states run from {states.min()} to {states.max()}, the skill has 0 to {known - 1}"
        )


def panel_rows(layout: Layout, chosen: list[int]) -> list[list[int]]:
    """The columns of a part side by side, parts of one column too, at most so many in a row."""
    parts: list[list[int]] = []
    alone = False  # whether the last row is of parts of one column
    for here in layout.slices:
        if not (part := [i for i in range(here.start, here.stop) if i in chosen]):
            continue
        single = here.stop - here.start == 1
        if single and alone:
            parts[-1] += part
        else:
            parts.append(part)
        alone = single
    return [
        part[n : n + MAX_PANELS_PER_ROW] for part in parts for n in range(0, len(part), MAX_PANELS_PER_ROW)
    ]


def _draw_lines(panel: Axes, motion: Motion, demonstration: Demonstration | None, column: int) -> None:
    if demonstration is not None:
        seconds = demonstration.period * np.arange(len(demonstration.x))
        panel.plot(seconds, demonstration.x[:, column], color=DEMONSTRATION, linestyle="--", linewidth=1.6)
    panel.plot(motion.period * np.arange(len(motion.x)), motion.x[:, column], color=MOTION, linewidth=1.6)


def _draw_bands(panel: Axes, skill: AdaptedSkill, states: Int[Array, " T"], column: int) -> None:
    """Mean and deviation of each visit, from half a step before its first to half a step past the last."""
    visited, lengths = state_segments(states)
    variances = np.diagonal(
        ambient_covariances(skill.means, skill.covariances, skill.layout), axis1=1, axis2=2
    )
    ends = np.cumsum(lengths)
    for k, first, end in zip(visited, ends - lengths, ends, strict=True):
        seconds = skill.period * np.array([first - 0.5, end - 0.5])
        mean, deviation = skill.means[k, column], np.sqrt(variances[k, column])
        colour = state_colour(int(k))
        band = panel.fill_between(seconds, mean - deviation, mean + deviation, color=colour, alpha=0.25)
        band.set(linewidth=0.0, gid=f"band of state {k}")
        panel.plot(seconds, [mean, mean], color=colour, linewidth=1.6)


def _handles(demonstration: bool, states: int) -> list[Artist]:
    handles: list[Artist] = [Line2D([], [], color=MOTION, label="tracked motion")]
    if demonstration:
        handles.append(Line2D([], [], color=DEMONSTRATION, linestyle="--", label="demonstration"))
    return [*handles, *state_legend_handles(states)]
