"""Demonstrations as each frame sees them, with what was learned there."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pilotfish.demonstrations import Demonstration, views
from pilotfish.errors import InvalidInput
from pilotfish.models import Skill
from pilotfish.plots.doors import Plane, chosen_planes, require_human, require_states
from pilotfish.plots.ellipses import draw_ellipses
from pilotfish.plots.kinds import require_kind, require_list
from pilotfish.plots.labels import settle
from pilotfish.plots.spreads import in_columns
from pilotfish.plots.style import FAINT, WIDTH, dress, legend_below, sheet, state_handles, with_unit
from pilotfish.types import Array, Float


def demonstrations_seen(
    skill: Skill, demonstrations: Sequence[Demonstration], *, planes: Sequence[Plane] | None = None
) -> Figure:
    """A row of panels for each frame: demonstrations as seen from it, and the states' 1-sigma ellipses.

    planes are pairs of column names; x-y and x-z of the position if not given. Where a frame matters, the
    demonstrations come together and the ellipses are small.
    Raises: InvalidInput, when demonstrations and skill differ in columns or frames, or states are too many.
    Source: after Tanwani 2018, figures 3.3 and 3.7.
    """
    require_kind("skill", skill, Skill)
    require_list("demonstrations", demonstrations, Demonstration)
    if not demonstrations:
        raise InvalidInput("no demonstrations were given, expected at least one")
    require_states(skill.states)
    chosen = chosen_planes(skill.layout, planes)
    for demonstration in demonstrations:
        require_human(demonstration, skill.layout)
    data = views(demonstrations)
    if (names := tuple(f.name for f in demonstrations[0].frames)) != skill.frame_names:
        raise InvalidInput(f"the demonstrations have the frames {names}, the skill {skill.frame_names}")
    rows, columns = len(skill.frame_names), len(chosen)
    figure = sheet(WIDTH if columns > 1 else 0.6 * WIDTH, 3.9 * rows + 0.5)
    panels = figure.subplots(rows, columns, squeeze=False)
    labels = {}
    for p, name in enumerate(skill.frame_names):
        paths = np.split(data.x[p], np.cumsum(data.lengths)[:-1])
        spreads = in_columns(skill.means[p], skill.covariances[p].dense, skill.layout)
        for panel, plane in zip(panels[p], chosen, strict=True):
            _draw_paths(panel, paths, plane)
            panel.plot(0.0, 0.0, marker="+", markersize=14, markeredgewidth=1.6, color="black", zorder=4)
            labels[panel] = draw_ellipses(panel, skill.means[p], spreads, plane, name)
            x, y = (with_unit(skill.layout, column) for column in plane)
            dress(panel, x=x, y=y, title=f"seen from {name!r}").set_aspect("equal", adjustable="datalim")
    legend_below(figure, [*_path_handles(), *state_handles(skill.states)])
    figure.draw_without_rendering()  # only then is known where labels stand
    for panel, numbers in labels.items():
        settle(panel, numbers, np.zeros((1, 2)))
    return figure


def _draw_paths(panel: Axes, paths: Sequence[Float[Array, "_ D"]], plane: tuple[int, int]) -> None:
    for path in paths:
        panel.plot(*path[:, plane].T, color=FAINT, linewidth=1.1, zorder=1)
        panel.plot(*path[0, list(plane)][:, None], marker="o", markersize=4, color="0.4", zorder=2)


def _path_handles() -> list[Line2D]:
    return [
        Line2D([], [], color=FAINT, label="demonstrations"),
        Line2D([], [], color="0.4", marker="o", markersize=4, linestyle="", label="their beginnings"),
        Line2D([], [], color="black", marker="+", markersize=10, linestyle="", label="origin of the frame"),
    ]
