"""Plot of frame relevance: heat maps of relevance and cost."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from pilotfish.models import FrameRelevance
from pilotfish.plots.style import DEMONSTRATION, SMALL_FONT, new_figure
from pilotfish.plots.validation import require_type
from pilotfish.types import Array, Float

WHITE_TEXT_THRESHOLD = 0.55  # fraction of the colour scale from which numbers are white
MAX_NUMBERED_STATES = 24  # states; of more, numbers would not fit their cells
CELL, TITLE = 0.48, 2.8  # inches
SIGNIFICANT_COST = 3.0  # nat; smaller costs are hardly significant
MIN_COST_SCALE = 10.0  # nat


def frame_relevance(frame_relevance: FrameRelevance) -> Figure:
    """Plot the relevance of each frame at each state, and below it the cost of leaving the frame out.

    The relevance is the power of the frame's Gaussian in the product, relative to the most relevant frame of
    the state. The cost is what held-out demonstrations lose if this frame alone is left out of the state
    [nat]. Its colours are linear up to three nats and logarithmic beyond. Frames without relevance at any
    state have grey names. Cells without a number are zero, or below 0.05 nat. Above 32 states only colours
    are drawn.

    Args:
        frame_relevance: Result of `models.relevance`.

    Returns:
        The figure.
    """
    require_type("frame_relevance", frame_relevance, FrameRelevance)
    figure = _new_figure(frame_relevance)
    above, below = figure.subplots(2, 1)
    _draw_heat_map(above, frame_relevance.values, Normalize(0.0, 1.0), _format_relevance, "relevance [1]")
    most = max(
        MIN_COST_SCALE, float(frame_relevance.costs[np.isfinite(frame_relevance.costs)].max(initial=0.0))
    )
    scale = SymLogNorm(SIGNIFICANT_COST, linscale=0.4, vmin=0.0, vmax=most)
    bar = _draw_heat_map(below, frame_relevance.costs, scale, _format_cost, "cost [nat]")
    bar.set_ticks([0.0, SIGNIFICANT_COST, *10.0 ** np.arange(1, np.log10(most) + 1e-9)])
    _label(above, frame_relevance, "relevance of each frame")
    _label(below, frame_relevance, "cost of leaving out this frame alone")
    return figure


def _new_figure(frame_relevance: FrameRelevance) -> Figure:
    P, K = frame_relevance.values.shape
    names = 0.1 * max(map(len, frame_relevance.frame_names))
    return new_figure(names + max(TITLE, CELL * min(K, MAX_NUMBERED_STATES)) + 1.7, 2.0 + 2.0 * CELL * P)


def _draw_heat_map(
    panel: Axes,
    values: Float[Array, "P K"],
    scale: Normalize,
    format_value: Callable[[float], str],
    label: str,
) -> Colorbar:
    """Draw a heat map with numbers where they fit, and its colour bar."""
    clipped = np.clip(values, scale.vmin, scale.vmax)
    image = panel.imshow(clipped, cmap="Blues", norm=scale, aspect="auto", interpolation="nearest")
    if values.shape[1] <= MAX_NUMBERED_STATES:
        for (p, k), value in np.ndenumerate(values):
            colour = "white" if scale(clipped[p, k]) > WHITE_TEXT_THRESHOLD else "black"
            panel.text(k, p, format_value(value), color=colour, fontsize=SMALL_FONT, ha="center", va="center")
    bar = panel.figure.colorbar(image, ax=panel, label=label, aspect=12)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    return bar


def _format_relevance(value: float) -> str:
    if value == 0.0:
        return ""
    return f"{value:.2f}".rstrip("0").rstrip(".") if value >= 0.005 else "<.01"


def _format_cost(cost: float) -> str:
    if cost < 0.05:
        return ""
    if np.isinf(cost):
        return "∞"
    return f"{cost:.1f}" if cost < 9.95 else f"{cost:.0f}"


def _label(panel: Axes, frame_relevance: FrameRelevance, title: str) -> None:
    P, K = frame_relevance.values.shape
    panel.set_title(title, loc="left", fontsize="medium", fontweight="bold")
    panel.set(xlabel="state", ylabel="frame")
    panel.set_yticks(range(P), frame_relevance.frame_names)
    for name, tick in zip(frame_relevance.frame_names, panel.get_yticklabels(), strict=True):
        tick.set_color(DEMONSTRATION if name in frame_relevance.distractors else "black")
    panel.xaxis.set_major_locator(MaxNLocator(min(K, MAX_NUMBERED_STATES), integer=True))
    panel.spines[:].set_visible(False)
    panel.tick_params(length=0)
    for edge in np.arange(K - 1) + 0.5:
        panel.axvline(edge, color="0.85", linewidth=0.8)
    for edge in np.arange(P - 1) + 0.5:
        panel.axhline(edge, color="0.85", linewidth=0.8)
