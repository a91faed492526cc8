"""Plot of model selection by reproduction: gain of each candidate over the default."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pilotfish.planning import ReproductionScore, ReproductionSelection
from pilotfish.plots.model_selection import MARKERS
from pilotfish.plots.style import COLUMN_COLOURS, FIGURE_WIDTH, legend_below, new_figure, style_axes
from pilotfish.plots.validation import require_type

MAX_OFFSET = 0.6  # states from the first to the last line, so that similar scores are distinct


def reproduction_selection(selection: ReproductionSelection) -> Figure:
    """Plot by how much each candidate reproduces better than the default, by number of states.

    Colours are structures, markers are durations and frames. Bars are the standard error of the difference
    over held-out demonstrations: a candidate whose bar reaches zero is about as good as the default, which is
    the line at zero. If the default has no score, the mean scores are drawn. The selected candidate has a
    ring; failed ones are missing.

    Args:
        selection: Result of `planning.select_by_reproduction` or `simulation.select_by_success`.

    Returns:
        The figure.

    Raises:
        InvalidInput: If all candidates failed.
    """
    require_type("selection", selection, ReproductionSelection)
    best = selection.best
    names = list(dict.fromkeys(map(_line_name, selection.scores)))
    structures = list(dict.fromkeys(name[0] for name in names))
    others = list(dict.fromkeys(name[1:] for name in names))
    shifts = np.linspace(-0.5, 0.5, len(names)) * MAX_OFFSET if len(names) > 1 else np.zeros(1)
    figure = new_figure(FIGURE_WIDTH, 4.6)
    axes = figure.subplots()
    handles = []
    for name, shift in zip(names, shifts, strict=True):
        scores = sorted((s for s in selection.scores if _line_name(s) == name), key=lambda s: s.states)
        colour = COLUMN_COLOURS[structures.index(name[0]) % len(COLUMN_COLOURS)]
        marker = MARKERS[others.index(name[1:]) % len(MARKERS)]
        _draw_line(axes, selection, scores, float(shift), colour, marker)
        handles.append(Line2D([], [], color=colour, marker=marker, markersize=4.5, label=", ".join(name)))
        if best in scores:
            x, y = best.states + shift, _height(selection, best)[0]
            axes.plot(x, y, "o", markersize=13, markerfacecolor="none", color="black", gid="selected")
    label = (
        "mean score [1]"
        if selection.default is None
        else "score of the default less that of the candidate [1]"
    )
    style_axes(axes, x="states", y=label, title="held-out reproductions" + _direction(selection))
    axes.axhline(0.0, color="0.3", linewidth=0.8)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend_below(figure, handles)
    figure.suptitle(f"Selected: {best.candidate.label}", fontsize="medium")
    return figure


def _direction(selection: ReproductionSelection) -> str:
    return " (lower is better)" if selection.default is None else " (higher is better)"


def _line_name(score: ReproductionScore) -> tuple[str, ...]:
    candidate = score.candidate
    frames = () if candidate.frames == "equal" else ("frames by relevance",)
    return (candidate.fitted_structure.label, candidate.dynamics_label, *frames)


def _height(selection: ReproductionSelection, score: ReproductionScore) -> tuple[float, float]:
    """Return the gain of a score over the default and its standard error; without it, the score's own."""
    return (score.mean, score.standard_error) if selection.default is None else selection.gain(score)


def _draw_line(
    axes: Axes,
    selection: ReproductionSelection,
    scores: Sequence[ReproductionScore],
    shift: float,
    colour: str,
    marker: str,
) -> None:
    heights, errors = np.array([_height(selection, score) for score in scores]).T
    x = np.array([score.states + shift for score in scores])
    axes.errorbar(x, heights, errors, color=colour, marker=marker, markersize=4.5, linewidth=1.0)
