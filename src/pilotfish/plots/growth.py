"""How a model grew with its stream."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pilotfish.errors import InvalidInput
from pilotfish.models import online
from pilotfish.plots.kinds import require_sequence
from pilotfish.plots.style import (
    BACKGROUND,
    FIGURE_WIDTH,
    legend_below,
    new_figure,
    state_colour,
    state_dash,
    state_legend_handles,
    style_axes,
)
from pilotfish.plots.validation import require_states
from pilotfish.types import Array, Float

LINE_OFFSET = 0.35  # dimensions from the first line to the last: equal ones stand side by side


def online_clusters(models: Sequence[online.OnlineModel]) -> Figure:
    """The number of clusters over the datapoints, and below it the dimension of each in every frame.

    models are one model at moments of its stream, earliest first. States are those of the last model, as it
    reads out; clusters that were merged or forgotten before are grey. Dimensions are whole numbers: lines are
    drawn a little to the side of each other.
    Raises: InvalidInput, when there is no model, they are of different streams or have too many states.
    Source: after Tanwani 2018, figure 5.6.
    """
    require_sequence("models", models, online.OnlineModel)
    if not models or not models[-1].clusters:
        raise InvalidInput("no model has a cluster to draw, expected the model at one moment at least")
    last = models[-1]
    require_states(last.clusters)
    times = [model.datapoints for model in models]
    if times != sorted(times) or any(model.frame_names != last.frame_names for model in models):
        raise InvalidInput("the models are not one model as it grew, expected its earliest moment first")
    figure = new_figure(FIGURE_WIDTH, 1.6 + 1.9 * (1 + len(last.frame_names)))
    above, *below = figure.subplots(1 + len(last.frame_names), 1, sharex=True)
    above.step(times, [model.clusters for model in models], where="post", color="black", linewidth=1.6)
    style_axes(above, x="", y="clusters K [1]")
    removed = False
    for p, axes in enumerate(below):
        for cluster_id, dimensions in _dimensions_by_cluster(models, p).items():
            style, index = _line_style(last, cluster_id)
            removed |= index < 0
            offset = LINE_OFFSET * (index / max(last.clusters - 1, 1) - 0.5) if index >= 0 else 0.0
            axes.step(
                times, dimensions + offset, where="post", gid=f"cluster {cluster_id} frame {p}", **style
            )
        name = last.frame_names[p] if len(below) > 1 else ""
        style_axes(axes, x="", y="dimension d [1]", title=name)
    for axes in (above, *below):
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    below[-1].set_xlabel("datapoints [1]")
    grey = [Line2D([], [], color=BACKGROUND, label="merged or forgotten since")] if removed else []
    legend_below(figure, [*state_legend_handles(last.clusters), *grey])
    return figure


def _dimensions_by_cluster(models: Sequence[online.OnlineModel], p: int) -> dict[int, Float[Array, " M"]]:
    """The dimension of every cluster there ever was in frame p, nan where it is not."""
    lines: dict[int, Float[Array, " M"]] = {}
    for m, model in enumerate(models):
        for cluster_id, d in zip(model.cluster_ids.tolist(), model.dimensions[:, p].tolist(), strict=True):
            lines.setdefault(cluster_id, np.full(len(models), np.nan))[m] = d
    return lines


def _line_style(last: online.OnlineModel, cluster_id: int) -> tuple[dict[str, object], int]:
    """How a cluster's line looks, and its place among the states; -1 when it is no more."""
    indices = np.flatnonzero(last.cluster_ids == cluster_id)
    if not len(indices):
        return {"color": BACKGROUND, "linewidth": 1.0, "zorder": 1}, -1
    k = int(indices[0])
    return {"color": state_colour(k), "linestyle": state_dash(k), "linewidth": 1.8, "zorder": 3}, k
