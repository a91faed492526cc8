"""Common style of all plots: figures, axes, legends and colours."""

from collections.abc import Sequence
from math import ceil

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.typing import LineStyleType

from pilotfish.demonstrations import Layout

# Six colours of Okabe & Ito 2008, without yellow, and two dark ones of Paul Tol.
STATE_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#332288", "#882255")
STATE_DASHES: tuple[LineStyleType, ...] = ("-", "--", ":", (0.0, (3.0, 1.0, 1.0, 1.0)))
MAX_STATES = len(STATE_COLOURS) * len(STATE_DASHES)

# Other lines are grey or black. Spatial axes, and columns named after them, have their own colours.
MOTION, DEMONSTRATION, BACKGROUND = "black", "0.45", "0.72"
AXIS_COLOURS = {"x": "#BB5566", "y": "#DDAA33", "z": "#004488", "w": "#66CCEE"}
COLUMN_COLOURS = (*AXIS_COLOURS.values(), "#44AA99", "#882255", "#999999", "#222222")

SMALL_FONT, FIGURE_WIDTH = 9.0, 10.0  # points; inches


def state_colour(state: int) -> str:
    """Return the colour of a state.

    Args:
        state: Index of the state, from 0.
    """
    return STATE_COLOURS[state % len(STATE_COLOURS)]


def state_dash(state: int) -> LineStyleType:
    """Return the dashes of a state: solid at first, others where the colours repeat."""
    return STATE_DASHES[state // len(STATE_COLOURS) % len(STATE_DASHES)]


def column_colour(name: str, index: int) -> str:
    """Return the colour of a column: that of its axis, otherwise by its index in the part."""
    return AXIS_COLOURS.get(name.rstrip("'").rpartition(" ")[2], COLUMN_COLOURS[index % len(COLUMN_COLOURS)])


def column_dash(name: str, index: int) -> LineStyleType:
    """Return the dashes of a column: solid at first, others where the colours repeat."""
    if name.rstrip("'").rpartition(" ")[2] in AXIS_COLOURS:
        return "-"
    return STATE_DASHES[index // len(COLUMN_COLOURS) % len(STATE_DASHES)]


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [inches] that fits its labels."""
    return Figure(figsize=(width, height), layout="constrained")


def style_axes(axes: Axes, *, x: str, y: str, title: str = "") -> Axes:
    """Set labels and title, draw a faint grid behind the data, and remove the upper and right spine."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title, loc="left", fontsize="medium", fontweight="bold")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def axis_label(layout: Layout, column: int) -> str:
    """Return the label of an axis: name and unit of a column."""
    return f"{layout.names[column]} [{layout.units[column]}]"


def add_outline(text: Text) -> Text:
    """Outline a text in white, so that it is readable over lines."""
    text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
    return text


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Draw one legend for the whole figure below the panels."""
    per_row = max(1, int(figure.get_figwidth() / max(0.75, 0.35 + 0.09 * _max_label_length(handles))))
    rows = ceil(len(handles) / per_row)
    columns = ceil(len(handles) / rows)
    figure.legend(
        handles=list(handles), loc="outside lower center", ncols=columns, frameon=False, fontsize=SMALL_FONT
    )


def _max_label_length(handles: Sequence[Artist]) -> int:
    return max(len(str(handle.get_label())) for handle in handles)


def state_legend_handles(states: int) -> list[Line2D]:
    """Return the legend entries of all states."""
    return [
        Line2D([], [], color=state_colour(k), linestyle=state_dash(k), linewidth=2.5, label=f"state {k}")
        for k in range(states)
    ]
