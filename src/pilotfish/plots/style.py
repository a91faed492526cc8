"""One look for every picture: sheets, axes, legends, and colours that mean the same everywhere."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from pilotfish.demonstrations import Layout

# Okabe & Ito 2008, Color universal design; without its yellow, which is lost on white.
STATE_COLOURS = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#D55E00",
    "#6B4C9A",
    "#555555",
)
DASHES = ("-", "--", ":")
MOST_STATES = len(STATE_COLOURS) * len(DASHES)

# What lies beside states is neutral; the axes of space and the columns of a part share three colours and a grey.
MOTION, HUMAN, FAINT = "black", "#BB5566", "0.72"
AXIS_COLOURS = {"x": "#BB5566", "y": "#117733", "z": "#004488", "w": "#777777"}
COLUMN_COLOURS = (*AXIS_COLOURS.values(), "#DDAA33", "#66CCEE", "#AA3377", "black")

SMALL, WIDTH = 9.0, 10.0  # points; inches


def state_colour(state: int) -> str:
    return STATE_COLOURS[state % len(STATE_COLOURS)]


def state_dash(state: int) -> str:
    """Solid for the first states; later ones repeat the colours with other dashes."""
    return DASHES[state // len(STATE_COLOURS) % len(DASHES)]


def column_colour(name: str, place: int) -> str:
    """Columns named for an axis have its colour, others that of their place in the part."""
    return AXIS_COLOURS.get(name.rstrip("'").rpartition(" ")[2], COLUMN_COLOURS[place % len(COLUMN_COLOURS)])


def sheet(width: float, height: float) -> Figure:
    """An empty figure [inches] that makes room for all it is labelled with."""
    return Figure(figsize=(width, height), layout="constrained")


@dataclass(frozen=True, slots=True)
class Grid:
    """Rows and columns that hold so many panels, as few empty as can be."""

    rows: int
    columns: int


def grid(panels: int, most_columns: int) -> Grid:
    rows = ceil(panels / most_columns)
    return Grid(rows, ceil(panels / rows))


def dress(axes: Axes, *, x: str, y: str, title: str = "") -> Axes:
    """Labels, faint lines behind the data, and no more frame than the data needs."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(title, loc="left", fontsize="medium", fontweight="bold")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    return axes


def with_unit(layout: Layout, column: int) -> str:
    """The label of an axis: a column's name and unit."""
    return f"{layout.names[column]} [{layout.units[column]}]"


def halo(text: Text) -> Text:
    """The same text, readable over lines."""
    text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
    return text


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """One legend for the whole sheet, under the panels, where it covers nothing."""
    columns = min(len(handles), max(1, int(figure.get_figwidth() // 1.5)))
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns, frameon=False, fontsize=SMALL)


def state_handles(states: int) -> list[Line2D]:
    """What a legend shows for each state."""
    return [
        Line2D([], [], color=state_colour(k), linestyle=state_dash(k), linewidth=2.5, label=f"state {k}")
        for k in range(states)
    ]
