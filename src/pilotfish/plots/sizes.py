"""How candidates for a model compare: the score on held-out demonstrations, and the Bayesian criterion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.typing import LineStyleType

from pilotfish.errors import InvalidInput
from pilotfish.models import Score, Selection
from pilotfish.plots.kinds import require_kind
from pilotfish.plots.style import COLUMN_COLOURS, WIDTH, dress, legend_below, sheet
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
MARKERS = "osD^P*Xp"  # one with each kind of dashes; "v" is an impossible demonstration
DODGE = 0.1  # states from line to line, so that what nearly coincides stands side by side
WIDEST = 0.6  # states from the first line to the last
LEAST = 0.1  # nats per datapoint: smaller differences are drawn in proportion, larger ones by their decades


HELD_OUT = "demonstrations held out (higher is better)"
ALL = "BIC, all demonstrations (lower is better)"


@dataclass(frozen=True, slots=True)
class Line:
    """The scores of one structure and one kind of durations, by their number of states."""

    scores: tuple[Score, ...]
    colour: str
    dash: LineStyleType
    marker: str
    shift: float

    @property
    def places(self) -> list[float]:
        """Numbers of states, a little to the side."""
        return [score.candidate.states + self.shift for score in self.scores]


def model_sizes(selection: Selection) -> Figure:
    """Scores by numbers of states: a colour for each structure, marks and dashes for each kind of durations.

    On the left the log-likelihood per datapoint of demonstrations held out, against the highest of all; bars
    are the standard error of that difference over demonstrations, so that a candidate whose bar reaches zero
    is about as good. The scale is linear near zero, logarithmic beyond; a triangle at the lower edge stands
    for demonstrations that are impossible. On the right the Bayesian information criterion of all
    demonstrations. Lines stand a little to the side of one another. The choice is ringed. Candidates that
    failed are missing.
    Raises: InvalidInput, when all candidates failed, or there are more structures or kinds of durations than
    can be told apart.
    """
    require_kind("selection", selection, Selection)
    best, top = selection.best, selection.likeliest
    structures, durations = _names(selection.scores)
    lines = _lines(selection.scores, structures, durations)
    figure = sheet(WIDTH, 4.6)
    left, right = figure.subplots(1, 2)
    left.set_yscale("symlog", linthresh=max(LEAST, _least(top)), linscale=0.8)
    for line in lines:
        _draw_held_out(left, line, top)
        right.plot(line.places, [score.bic for score in line.scores], **_look(line))
        if best in line.scores:
            _ring(left, best.candidate.states + line.shift, float(_gains(best, top).mean()))
            _ring(right, best.candidate.states + line.shift, best.bic)
    dress(left, x="states", y="log-likelihood per datapoint,\nagainst the best [nat]", title=HELD_OUT)
    dress(right, x="states", y="Bayesian information criterion [nat]", title=ALL)
    for axes in (left, right):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    legend_below(figure, _handles(structures, durations))
    figure.suptitle(f"Chosen: {best.candidate.label}", fontsize="medium")
    return figure


def _names(scores: Sequence[Score]) -> tuple[list[str], list[str]]:
    structures, durations = (list(dict.fromkeys(names)) for names in zip(*map(_pair, scores), strict=True))
    for name, there, most in (
        ("structures", structures, len(COLUMN_COLOURS)),
        ("kinds of durations", durations, len(LINE_DASHES)),
    ):
        if len(there) > most:
            raise InvalidInput(f"there are {len(there)} {name}, expected at most {most}: draw fewer at once")
    return structures, durations


def _lines(scores: Sequence[Score], structures: Sequence[str], durations: Sequence[str]) -> list[Line]:
    """One structure's kinds of durations are the likeliest to coincide, and stand the furthest apart."""
    there = set(map(_pair, scores))
    pairs = [(s, d) for d in durations for s in structures if (s, d) in there]
    reach = min(WIDEST, DODGE * (len(pairs) - 1)) / 2
    shifts = np.linspace(-reach, reach, len(pairs))
    return [
        Line(
            tuple(sorted((s for s in scores if _pair(s) == pair), key=lambda s: s.candidate.states)),
            COLUMN_COLOURS[structures.index(pair[0])],
            LINE_DASHES[durations.index(pair[1])],
            MARKERS[durations.index(pair[1])],
            float(shift),
        )
        for pair, shift in zip(pairs, shifts, strict=True)
    ]


def _pair(score: Score) -> tuple[str, str]:
    return score.candidate.structure.label, score.candidate.durations


def _gains(score: Score, top: Score) -> Float[Array, " M"]:
    """Demonstration by demonstration; where neither explains one, there is nothing to tell."""
    with np.errstate(invalid="ignore"):
        return np.asarray(score.held_out - top.held_out)


def _least(top: Score) -> float:
    return 0.1 * top.standard_error if np.isfinite(top.standard_error) else 0.0


def _draw_held_out(axes: Axes, line: Line, top: Score) -> None:
    x = np.array(line.places)
    gains = np.array([_gains(score, top) for score in line.scores])  # (lines' scores, M)
    seen = np.isfinite(gains).all(axis=1)
    axes.errorbar(
        x[seen],
        gains[seen].mean(axis=1),
        gains[seen].std(axis=1, ddof=1) / np.sqrt(gains.shape[1]),
        elinewidth=0.9,
        **_look(line),
    )
    edge = axes.get_xaxis_transform()
    axes.plot(x[~seen], np.full((~seen).sum(), 0.03), "v", color=line.colour, markersize=6, transform=edge)


def _look(line: Line) -> dict[str, Any]:
    return {
        "color": line.colour,
        "linestyle": line.dash,
        "linewidth": 1.0,
        "marker": line.marker,
        "markersize": 4.5,
    }


def _ring(axes: Axes, x: float, y: float) -> None:
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
