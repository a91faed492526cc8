"""Plot of demonstrations and states in the coordinates of each frame."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pilotfish.demonstrations import Demonstration, views
from pilotfish.errors import InvalidInput
from pilotfish.models import Skill
from pilotfish.plots.ambient_covariances import ambient_covariances
from pilotfish.plots.ellipses import draw_ellipses
from pilotfish.plots.labels import place_labels
from pilotfish.plots.style import (
    BACKGROUND,
    FIGURE_WIDTH,
    axis_label,
    legend_below,
    new_figure,
    state_legend_handles,
    style_axes,
)
from pilotfish.plots.validation import (
    Plane,
    plane_columns,
    require_same_columns,
    require_sequence,
    require_states,
    require_type,
)
from pilotfish.types import Array, Float


def demonstrations_in_frames(
    skill: Skill, demonstrations: Sequence[Demonstration], *, planes: Sequence[Plane] | None = None
) -> Figure:
    """Plot demonstrations and 1-sigma ellipses of states in the coordinates of each frame.

    Where a frame is relevant, demonstrations converge and ellipses are small.

    Args:
        skill: Learned skill.
        demonstrations: At least one demonstration with the columns and frames of the skill.
        planes: Pairs of column names; None for x-y and x-z of the first position.

    Returns:
        The figure.

    Raises:
        InvalidInput: If demonstrations and skill differ in columns or frames, or there are too many states.

    Source:
        After Tanwani 2018, figures 3.3 and 3.7.
    """
    require_type("skill", skill, Skill)
    require_sequence("demonstrations", demonstrations, Demonstration)
    if not demonstrations:
        raise InvalidInput("demonstrations is empty, expected at least one")
    require_states(skill.states)
    plane_indices = plane_columns(skill.layout, planes)
    for demonstration in demonstrations:
        require_same_columns(demonstration, skill.layout)
    data = views(demonstrations)
    if (names := tuple(f.name for f in demonstrations[0].frames)) != skill.frame_names:
        raise InvalidInput(
            f"the demonstrations have the frames {names}, expected {skill.frame_names} as the skill"
        )
    rows, columns = len(skill.frame_names), len(plane_indices)
    figure = new_figure(FIGURE_WIDTH if columns > 1 else 0.6 * FIGURE_WIDTH, 3.9 * rows + 0.5)
    panels = figure.subplots(rows, columns, squeeze=False)
    labels = {}
    for p, name in enumerate(skill.frame_names):
        paths = np.split(data.x[p], np.cumsum(data.lengths)[:-1])
        covariances = ambient_covariances(skill.means[p], skill.covariances[p].dense, skill.layout)
        for panel, plane in zip(panels[p], plane_indices, strict=True):
            _draw_paths(panel, paths, plane)
            panel.plot(0.0, 0.0, marker="+", markersize=14, markeredgewidth=1.6, color="black", zorder=4)
            labels[panel] = draw_ellipses(panel, skill.means[p], covariances, plane, name)
            x, y = (axis_label(skill.layout, column) for column in plane)
            style_axes(panel, x=x, y=y, title=f"frame {name!r}").set_aspect("equal", adjustable="datalim")
    legend_below(figure, [*_path_handles(), *state_legend_handles(skill.states)])
    figure.draw_without_rendering()  # label positions are known afterwards
    for panel, numbers in labels.items():
        place_labels(panel, numbers, np.zeros((1, 2)))
    return figure


def _draw_paths(panel: Axes, paths: Sequence[Float[Array, "_ D"]], plane: tuple[int, int]) -> None:
    for path in paths:
        panel.plot(*path[:, plane].T, color=BACKGROUND, linewidth=1.1, zorder=1)
        panel.plot(*path[0, list(plane)][:, None], marker="o", markersize=4, color="0.4", zorder=2)


def _path_handles() -> list[Line2D]:
    return [
        Line2D([], [], color=BACKGROUND, label="demonstrations"),
        Line2D([], [], color="0.4", marker="o", markersize=4, linestyle="", label="starts"),
        Line2D([], [], color="black", marker="+", markersize=10, linestyle="", label="origin of the frame"),
    ]
