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
from pilotfish.models import AdaptedSkill, runs
from pilotfish.plots.doors import (
    chosen_columns,
    require_human,
    require_motion,
    require_period,
    require_states,
)
from pilotfish.plots.kinds import require_array, require_kind
from pilotfish.plots.spreads import in_columns
from pilotfish.plots.style import (
    HUMAN,
    MOTION,
    dress,
    legend_below,
    sheet,
    state_colour,
    state_handles,
    with_unit,
)
from pilotfish.types import Array, Int

ABREAST = 4


def tracked_coordinates(
    skill: AdaptedSkill,
    states: Int[Array, " T"],
    motion: Motion,
    *,
    human: Demonstration | None = None,
    columns: Sequence[str] | None = None,
) -> Figure:
    """A panel for each column: the planned states' means with bands of one deviation, and the motion on top.

    states is the planned sequence, one a step of the motion. Bands are the model's, without the slack that a
    plan adds: a wide band is where the tracker may yield. columns are names; all that are no derivatives if
    not given.
    Raises: InvalidInput, when lengths, widths or periods differ, or a state or column is unknown.
    """
    require_kind("skill", skill, AdaptedSkill)
    require_kind("motion", motion, Motion)
    require_array("states", states, "T", np.integer, "pilotfish.planning.planned_states makes one")
    require_states(skill.states)
    require_motion(motion, skill.layout)
    require_period("the motion", motion.period, skill.period)
    if human is not None:
        require_human(human, skill.layout)
        require_period(f"demonstration {human.name!r}", human.period, skill.period)
    _require_plan(states, skill.states, len(motion.x))
    rows = column_rows(skill.layout, chosen_columns(skill.layout, columns))
    most = max(map(len, rows))
    figure = sheet(max(5.0, 3.2 * most), 2.4 * len(rows) + 0.8)
    cells = figure.add_gridspec(len(rows), most)
    for r, row in enumerate(rows):
        for c, column in enumerate(row):
            panel = dress(figure.add_subplot(cells[r, c]), x="time [s]", y=with_unit(skill.layout, column))
            _draw_bands(panel, skill, states, column)
            _draw_lines(panel, motion, human, column)
    legend_below(figure, _handles(human is not None, skill.states))
    return figure


def _require_plan(states: Int[Array, " T"], known: int, steps: int) -> None:
    if len(states) != steps:
        raise InvalidInput(
            f"{len(states)} states were planned, expected {steps}: one for each step of the motion"
        )
    if states.min() < 0 or states.max() >= known:
        raise InvalidInput(
            f"states run from {states.min()} to {states.max()}, the skill has 0 to {known - 1}"
        )


def column_rows(layout: Layout, chosen: list[int]) -> list[list[int]]:
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
    return [part[n : n + ABREAST] for part in parts for n in range(0, len(part), ABREAST)]


def _draw_lines(panel: Axes, motion: Motion, human: Demonstration | None, column: int) -> None:
    if human is not None:
        seconds = human.period * np.arange(len(human.x))
        panel.plot(seconds, human.x[:, column], color=HUMAN, linestyle="--", linewidth=1.6)
    panel.plot(motion.period * np.arange(len(motion.x)), motion.x[:, column], color=MOTION, linewidth=1.6)


def _draw_bands(panel: Axes, skill: AdaptedSkill, states: Int[Array, " T"], column: int) -> None:
    """Mean and deviation of each visit, from half a step before its first to half a step past the last."""
    visited, lengths = runs(states)
    variances = np.diagonal(in_columns(skill.means, skill.covariances, skill.layout), axis1=1, axis2=2)
    ends = np.cumsum(lengths)
    for k, first, end in zip(visited, ends - lengths, ends, strict=True):
        seconds = skill.period * np.array([first - 0.5, end - 0.5])
        mean, deviation = skill.means[k, column], np.sqrt(variances[k, column])
        colour = state_colour(int(k))
        band = panel.fill_between(seconds, mean - deviation, mean + deviation, color=colour, alpha=0.25)
        band.set(linewidth=0.0, gid=f"band of state {k}")
        panel.plot(seconds, [mean, mean], color=colour, linewidth=1.6)


def _handles(human: bool, states: int) -> list[Artist]:
    handles: list[Artist] = [Line2D([], [], color=MOTION, label="tracked motion")]
    if human:
        handles.append(Line2D([], [], color=HUMAN, linestyle="--", label="demonstration"))
    return [*handles, *state_handles(states)]
