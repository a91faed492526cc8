"""Plot of model selection: held-out score and Bayesian information criterion of candidates."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.typing import LineStyleType

from pilotfish.errors import InvalidInput
from pilotfish.models import Score, Selection
from pilotfish.plots.style import COLUMN_COLOURS, FIGURE_WIDTH, legend_below, new_figure, style_axes
from pilotfish.plots.validation import require_type
from pilotfish.types import Array, Float

LINE_DASHES: tuple[LineStyleType, ...] = (
    "-",
    "--",
    ":",
    "-.",
    (0.0, (5.0, 1.0, 1.0, 1.0, 1.0, 1.0)),
    (0.0, (1.0, 4.0)),
    (0.0, (8.0, 3.0)),
    (0.0, (2.0, 2.0, 6.0, 2.0)),
)
MARKERS = "osD^P*Xp"  # one per dash pattern; "v" marks an impossible demonstration
LINE_OFFSET = 0.1  # states from line to line, so that similar scores are distinct
MAX_OFFSET = 0.6  # states from the first to the last line
MIN_LINEAR_RANGE = (
    0.1  # nats per datapoint: smaller differences are drawn in proportion, larger ones by their decades
)


HELD_OUT_TITLE = "held-out demonstrations (higher is better)"
BIC_TITLE = "BIC, all demonstrations (lower is better)"
# Scores in order of the number of states, horizontal offset [states], and style of the line.
ScoreLine = tuple[tuple[Score, ...], float, dict[str, Any]]


def model_selection(selection: Selection) -> Figure:
    """Plot the scores of candidates by number of states.

    Colours are structures, markers and dashes are duration models. On the left is the log-likelihood per
    datapoint of held-out demonstrations, relative to the highest. Bars are the standard error of this
    difference over demonstrations: a candidate whose bar reaches zero is about as good. The scale is linear
    near zero and logarithmic beyond; a triangle at the lower edge marks impossible demonstrations. On the
    right is the Bayesian information criterion of all demonstrations. The selected candidate has a ring;
    failed ones are missing.

    Args:
        selection: Result of `models.select`.

    Returns:
        The figure.

    Raises:
        InvalidInput: If all candidates failed, or there are too many structures or duration models to
            distinguish.
    """
    require_type("selection", selection, Selection)
    best, top = selection.best, selection.highest_held_out
    structures, durations = _line_names(selection.scores)
    lines = _lines(selection.scores, structures, durations)
    figure = new_figure(FIGURE_WIDTH, 4.6)
    left, right = figure.subplots(1, 2)
    left.set_yscale("symlog", linthresh=max(MIN_LINEAR_RANGE, _linear_range(top)), linscale=0.8)
    for scores, shift, style in lines:
        x = np.array([_state_count(score) + shift for score in scores])
        _draw_held_out(left, x, np.array([_differences(score, top) for score in scores]), style)
        right.plot(x, [score.bic for score in scores], **style)
        if best in scores:
            _mark_selected(left, _state_count(best) + shift, float(_differences(best, top).mean()))
            _mark_selected(right, _state_count(best) + shift, best.bic)
    style_axes(
        left, x="states", y="log-likelihood per datapoint,\nrelative to the best [nat]", title=HELD_OUT_TITLE
    )
    style_axes(right, x="states", y="Bayesian information criterion [nat]", title=BIC_TITLE)
    for axes in (left, right):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    legend_below(figure, _handles(structures, durations))
    figure.suptitle(f"Selected: {best.candidate.label}", fontsize="medium")
    return figure


def _line_names(scores: Sequence[Score]) -> tuple[list[str], list[str]]:
    structures, durations = (
        list(dict.fromkeys(names)) for names in zip(*map(_line_name, scores), strict=True)
    )
    for name, present, most in (
        ("structures", structures, len(COLUMN_COLOURS)),
        ("duration models", durations, len(LINE_DASHES)),
    ):
        if len(present) > most:
            raise InvalidInput(
                f"there are {len(present)} {name}, expected at most {most}; draw fewer at once"
            )
    return structures, durations


def _lines(scores: Sequence[Score], structures: Sequence[str], durations: Sequence[str]) -> list[ScoreLine]:
    """Return one line per structure and duration model; those of one structure are furthest apart."""
    present = set(map(_line_name, scores))
    pairs = [(s, d) for d in durations for s in structures if (s, d) in present]
    half_width = min(MAX_OFFSET, LINE_OFFSET * (len(pairs) - 1)) / 2
    shifts = np.linspace(-half_width, half_width, len(pairs))
    return [
        (
            tuple(sorted((s for s in scores if _line_name(s) == pair), key=_state_count)),
            float(shift),
            _line_style(structures.index(pair[0]), durations.index(pair[1])),
        )
        for pair, shift in zip(pairs, shifts, strict=True)
    ]


def _state_count(score: Score) -> int:
    return score.candidate.states or score.states


def _line_name(score: Score) -> tuple[str, str]:
    return score.candidate.fitted_structure.label, score.candidate.dynamics_label


def _differences(score: Score, top: Score) -> Float[Array, " M"]:
    """Return the differences by demonstration; nan where both are impossible."""
    with np.errstate(invalid="ignore"):
        return np.asarray(score.held_out - top.held_out)


def _linear_range(top: Score) -> float:
    return 0.1 * top.standard_error if np.isfinite(top.standard_error) else 0.0


def _draw_held_out(
    axes: Axes, x: Float[Array, " N"], differences: Float[Array, "N M"], style: dict[str, Any]
) -> None:
    possible = np.isfinite(differences).all(axis=1)
    axes.errorbar(
        x[possible],
        differences[possible].mean(axis=1),
        differences[possible].std(axis=1, ddof=1) / np.sqrt(differences.shape[1]),
        elinewidth=0.9,
        **style,
    )
    marks = {"color": style["color"], "markersize": 6, "transform": axes.get_xaxis_transform()}
    axes.plot(x[~possible], np.full((~possible).sum(), 0.03), "v", **marks)


def _line_style(structure: int, duration: int) -> dict[str, Any]:
    return {
        "color": COLUMN_COLOURS[structure],
        "linestyle": LINE_DASHES[duration],
        "linewidth": 1.0,
        "marker": MARKERS[duration],
        "markersize": 4.5,
    }


def _mark_selected(axes: Axes, x: float, y: float) -> None:
    axes.plot(x, y, "o", markersize=13, markerfacecolor="none", color="black", zorder=6)


def _handles(structures: Sequence[str], durations: Sequence[str]) -> list[Line2D]:
    coloured = [
        Line2D([], [], color=colour, linewidth=2.5, label=name)
        for name, colour in zip(structures, COLUMN_COLOURS, strict=False)
    ]
    dashed = [
        Line2D([], [], color="0.3", linestyle=dash, marker=marker, markersize=4.5, label=name)
        for name, dash, marker in zip(durations, LINE_DASHES, MARKERS, strict=False)
    ]
    return coloured + dashed
