"""Plot of the growth of an online model."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pilotfish.errors import InvalidInput
from pilotfish.models import online
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
from pilotfish.plots.validation import require_sequence, require_states
from pilotfish.types import Array, Float

LINE_OFFSET = 0.35  # dimensions between the first and the last line, so that equal ones are distinct


def online_clusters(models: Sequence[online.OnlineModel]) -> Figure:
    """Plot the number of clusters over the datapoints, and the dimension of each cluster in every frame.

    States are those of the last model. Clusters that were merged or deleted before are grey. Dimensions are
    whole numbers; their lines are drawn slightly apart.

    Args:
        models: One model at several times of its stream, earliest first.

    Returns:
        The figure.

    Raises:
        InvalidInput: If models is empty, they are of different streams, or the last has too many states.

    Source:
        After Tanwani 2018, figure 5.6.
    """
    require_sequence("models", models, online.OnlineModel)
    if not models or not models[-1].clusters:
        raise InvalidInput("models has no model with a cluster, expected at least one")
    last = models[-1]
    require_states(last.clusters)
    times = [model.datapoints for model in models]
    if times != sorted(times) or any(model.frame_names != last.frame_names for model in models):
        raise InvalidInput("models are not one model in order of time, expected the earliest first")
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
    grey = [Line2D([], [], color=BACKGROUND, label="merged or deleted")] if removed else []
    legend_below(figure, [*state_legend_handles(last.clusters), *grey])
    return figure


def _dimensions_by_cluster(models: Sequence[online.OnlineModel], p: int) -> dict[int, Float[Array, " M"]]:
    """Return the dimension of every cluster in frame p over the models, nan where it does not exist."""
    lines: dict[int, Float[Array, " M"]] = {}
    for m, model in enumerate(models):
        for cluster_id, d in zip(model.cluster_ids.tolist(), model.dimensions[:, p].tolist(), strict=True):
            lines.setdefault(cluster_id, np.full(len(models), np.nan))[m] = d
    return lines


def _line_style(last: online.OnlineModel, cluster_id: int) -> tuple[dict[str, object], int]:
    """Return the line style of a cluster and its state index; -1 if it was deleted."""
    indices = np.flatnonzero(last.cluster_ids == cluster_id)
    if not len(indices):
        return {"color": BACKGROUND, "linewidth": 1.0, "zorder": 1}, -1
    k = int(indices[0])
    return {"color": state_colour(k), "linestyle": state_dash(k), "linewidth": 1.8, "zorder": 3}, k
