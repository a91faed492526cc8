"""Plot of coordinates over time: planned states, tracked motion and demonstration."""

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
from pilotfish.plots.ambient_covariances import ambient_covariances
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
    require_array,
    require_motion,
    require_period,
    require_same_columns,
    require_states,
    require_type,
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
    """Plot the planned means with bands of one standard deviation, and the motion, in a panel per column.

    Args:
        skill: Adapted skill. The bands are those of its covariances, without the regularisation of a plan:
            the tracker may deviate further where a band is wide.
        states: Planned state of each step of the motion.
        motion: Tracked motion.
        demonstration: Demonstration in the same situation, for comparison.
        columns: Names of columns; None for all that are not derivatives.

    Returns:
        The figure.

    Raises:
        InvalidInput: If lengths, columns or periods differ, or a state or column is unknown.
    """
    require_type("skill", skill, AdaptedSkill)
    require_type("motion", motion, Motion)
    require_array("states", states, "T", np.integer, "planning.plan_states makes one")
    require_states(skill.states)
    require_motion(motion, skill.layout)
    require_period("the motion", motion.period, skill.period)
    if demonstration is not None:
        require_same_columns(demonstration, skill.layout)
        require_period(f"demonstration {demonstration.name!r}", demonstration.period, skill.period)
    _require_planned_states(states, skill.states, len(motion.x))
    rows = panel_rows(skill.layout, column_indices(skill.layout, columns))
    width = max(map(len, rows))
    figure = new_figure(max(5.0, 3.2 * width), 2.4 * len(rows) + 0.8)
    cells = figure.add_gridspec(len(rows), width)
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
            f"states has {len(states)} entries, expected {steps}: one for each step of the motion"
        )
    if states.min() < 0 or states.max() >= known:
        raise InvalidInput(
            f"states has entries from {states.min()} to {states.max()}, expected 0 to {known - 1}"
        )


def panel_rows(layout: Layout, chosen: list[int]) -> list[list[int]]:
    """Return the columns of each row of panels: those of one part, and parts of one column together."""
    parts: list[list[int]] = []
    last_is_single = False  # whether the last row has parts of one column
    for columns in layout.slices:
        if not (part := [i for i in range(columns.start, columns.stop) if i in chosen]):
            continue
        is_single = columns.stop - columns.start == 1
        if is_single and last_is_single:
            parts[-1] += part
        else:
            parts.append(part)
        last_is_single = is_single
    return [
        part[n : n + MAX_PANELS_PER_ROW] for part in parts for n in range(0, len(part), MAX_PANELS_PER_ROW)
    ]


def _draw_lines(panel: Axes, motion: Motion, demonstration: Demonstration | None, column: int) -> None:
    if demonstration is not None:
        seconds = demonstration.period * np.arange(len(demonstration.x))
        panel.plot(seconds, demonstration.x[:, column], color=DEMONSTRATION, linestyle="--", linewidth=1.6)
    panel.plot(motion.period * np.arange(len(motion.x)), motion.x[:, column], color=MOTION, linewidth=1.6)


def _draw_bands(panel: Axes, skill: AdaptedSkill, states: Int[Array, " T"], column: int) -> None:
    """Draw mean and standard deviation of each segment, half a step beyond its ends."""
    segment_states, lengths = state_segments(states)
    variances = np.diagonal(
        ambient_covariances(skill.means, skill.covariances, skill.layout), axis1=1, axis2=2
    )
    ends = np.cumsum(lengths)
    for k, first, end in zip(segment_states, ends - lengths, ends, strict=True):
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
