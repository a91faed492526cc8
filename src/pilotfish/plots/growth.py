"""How a model grew with its stream."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pilotfish.errors import InvalidInput
from pilotfish.models import online
from pilotfish.plots.doors import require_states
from pilotfish.plots.kinds import require_list
from pilotfish.plots.style import (
    FAINT,
    WIDTH,
    dress,
    legend_below,
    sheet,
    state_colour,
    state_dash,
    state_handles,
)
from pilotfish.types import Array, Float

DODGE = 0.35  # dimensions from the first line to the last: equal ones stand side by side


def growth(models: Sequence[online.OnlineModel]) -> Figure:
    """The number of clusters over the datapoints, and below it the dimension of each in every frame.

    models are one model at moments of its stream, earliest first. States are those of the last model, as it
    reads out; clusters that were merged or forgotten before are grey. Dimensions are whole numbers: lines are
    drawn a little to the side of each other.
    Raises: InvalidInput, when there is no model, they are of different streams or have too many states.
    Source: after Tanwani 2018, figure 5.6.
    """
    require_list("models", models, online.OnlineModel)
    if not models or not models[-1].clusters:
        raise InvalidInput("no model has a cluster to draw, expected the model at one moment at least")
    last = models[-1]
    require_states(last.clusters)
    times = [model.datapoints for model in models]
    if times != sorted(times) or any(model.frame_names != last.frame_names for model in models):
        raise InvalidInput("the models are not one model as it grew, expected its earliest moment first")
    figure = sheet(WIDTH, 1.6 + 1.9 * (1 + len(last.frame_names)))
    above, *below = figure.subplots(1 + len(last.frame_names), 1, sharex=True)
    above.step(times, [model.clusters for model in models], where="post", color="black", linewidth=1.6)
    dress(above, x="", y="clusters K [1]")
    gone = False
    for p, axes in enumerate(below):
        for identity, dimensions in _lines(models, p).items():
            style, place = _style(last, identity)
            gone |= place < 0
            off = DODGE * (place / max(last.clusters - 1, 1) - 0.5) if place >= 0 else 0.0
            axes.step(times, dimensions + off, where="post", gid=f"cluster {identity} frame {p}", **style)
        name = last.frame_names[p] if len(below) > 1 else ""
        dress(axes, x="", y="dimension d [1]", title=name)
    for axes in (above, *below):
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    below[-1].set_xlabel("datapoints [1]")
    grey = [Line2D([], [], color=FAINT, label="merged or forgotten since")] if gone else []
    legend_below(figure, [*state_handles(last.clusters), *grey])
    return figure


def _lines(models: Sequence[online.OnlineModel], p: int) -> dict[int, Float[Array, " M"]]:
    """The dimension of every cluster there ever was in frame p, nan where it is not."""
    lines: dict[int, Float[Array, " M"]] = {}
    for m, model in enumerate(models):
        for identity, d in zip(model.identities.tolist(), model.dimensions[:, p].tolist(), strict=True):
            lines.setdefault(identity, np.full(len(models), np.nan))[m] = d
    return lines


def _style(last: online.OnlineModel, identity: int) -> tuple[dict[str, object], int]:
    """How a cluster's line looks, and its place among the states; -1 when it is no more."""
    places = np.flatnonzero(last.identities == identity)
    if not len(places):
        return {"color": FAINT, "linewidth": 1.0, "zorder": 1}, -1
    k = int(places[0])
    return {"color": state_colour(k), "linestyle": state_dash(k), "linewidth": 1.8, "zorder": 3}, k
