"""A semi-Markov skill as a graph: which state follows which, and how long each lasts."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import withStroke

from pilotfish.errors import InvalidInput
from pilotfish.models import (
    AdaptedSkill,
    SemiMarkovChain,
    Skill,
    occupancy,
)
from pilotfish.plots.doors import require_states
from pilotfish.plots.kinds import require_kind, require_real
from pilotfish.plots.style import SMALL, dress, halo, sheet, state_colour, state_dash
from pilotfish.types import Array, Int

UNIT = 1.35  # inches between nodes
RADIUS = 0.27  # of a node; nodes stand one apart
RING = RADIUS + 0.06  # around a final node
RISE = 0.22  # how much higher an arrow climbs for each further node it passes over
LINE = 0.2  # between names of goals in other rows
ABREAST, MARGIN = 10, 1  # most states in a row; room at its end, in nodes, when there are several
DURATIONS = 2.2  # inches that the densities of a row are high
OUT_OF_SIGHT = 1e-4  # how much of a state's durations lies to the right of what is drawn


@dataclass(frozen=True, slots=True)
class Row:
    """Where states of a row stand, the arrows within and out of it, and the heights it needs.

    Arrows within lie between foot and top; low and high have room for what stands beyond.
    """

    place: dict[int, int]
    within: list[tuple[int, int]]
    leaving: list[tuple[int, int]]
    foot: float
    top: float
    low: float
    high: float


def state_graph(skill: Skill | AdaptedSkill, *, least: float = 0.01) -> Figure:
    """States from left to right in order of time, transitions as arrows, and durations under each state.

    Many states fill several rows; an arrow to another row points up and names its goal. Others run above
    when they lead onward and below when back; those less probable than least are left out. A double ring is
    a final state, an arrow from nowhere tells how probable it is to begin there. Under each state: how
    probable it is that a visit lasts so long, and mean and deviation of its law [s].
    Raises: InvalidInput, when the skill is not semi-Markov, has too many states or least is no probability.
    Source: after Tanwani 2018, figure 3.6.
    """
    require_kind("skill", skill, Skill, AdaptedSkill)
    require_real("least", least)
    chain = skill.dynamics
    if not isinstance(chain, SemiMarkovChain):
        raise InvalidInput(
            f"the skill has {type(chain).__name__}, expected a SemiMarkovChain: learn makes one"
        )
    if not 0.0 <= least <= 1.0:
        raise InvalidInput(f"least is {least}, expected a probability such as .01")
    require_states(skill.states)
    lines = _lines(_in_time(chain))
    arrows = [
        (int(i), int(j)) for i, j in np.argwhere((chain.transitions >= least) & (chain.transitions > 0.0))
    ]
    rows = [_row(line, arrows) for line in lines]
    heights = [part for row in rows for part in (UNIT * (row.high - row.low), DURATIONS)]
    breadth = len(lines[0]) + MARGIN * (len(lines) > 1)
    figure = sheet(max(5.0, UNIT * breadth + 0.8), sum(heights))
    cells = figure.add_gridspec(2 * len(rows), 1, height_ratios=heights)
    for n, row in enumerate(rows):
        graph = figure.add_subplot(cells[2 * n])
        graph.set(xlim=(-0.5, breadth - 0.5), ylim=(row.low, row.high), aspect="equal")
        graph.axis("off")
        _draw_graph(graph, chain, row)
        _draw_durations(figure, cells[2 * n + 1], chain, lines[n], breadth, skill.period)
    return figure


def _lines(order: Int[Array, " K"]) -> list[Int[Array, " L"]]:
    """States in lines of equal length, but for the last; so few that a page holds them."""
    length = ceil(len(order) / ceil(len(order) / ABREAST))
    return [order[n : n + length] for n in range(0, len(order), length)]


def _row(line: Int[Array, " L"], arrows: list[tuple[int, int]]) -> Row:
    place = {int(state): x for x, state in enumerate(line)}
    within = [(i, j) for i, j in arrows if i in place and j in place]
    leaving = [(i, j) for i, j in arrows if i in place and j not in place]
    peaks = [_peak(place[i], place[j]) for i, j in within]
    top, foot = max([RING, *peaks]) + 0.2, min([-RING - 0.2, *peaks]) - 0.2
    most = max((sum(i == k for i, _ in leaving) for k in place), default=0)
    return Row(place, within, leaving, foot, top, foot - 0.12, top + LINE * most)


def _in_time(chain: SemiMarkovChain) -> Int[Array, " K"]:
    """States by the average time at which the skill is in them; those never reached come last."""
    horizon = int(np.ceil(chain.durations.means.sum())) + 1
    shares = occupancy(chain, np.empty((0, len(chain.initial))), horizon)  # (T, K)
    mass = shares.sum(axis=0)
    times = np.divide(np.arange(horizon) @ shares, mass, out=np.full(len(mass), np.inf), where=mass > 0.0)
    return np.argsort(times, kind="stable")


def _peak(start: int, end: int) -> float:
    """How high an arrow climbs between two places; negative if it leads back and hangs below."""
    hops = end - start
    return 0.0 if hops == 1 else float(np.sign(hops)) * (RING + 0.1 + RISE * (abs(hops) - 1))


def _draw_graph(axes: Axes, chain: SemiMarkovChain, row: Row) -> None:
    final, place = np.asarray(~chain.transitions.any(axis=1)), row.place
    nodes = {k: _draw_node(axes, x, k, final=bool(final[k])) for k, x in place.items()}
    for i, j in row.within:
        arrow = FancyArrowPatch((place[i], 0.0), (place[j], 0.0), patchA=nodes[i], patchB=nodes[j], zorder=2)
        _draw_arrow(axes, arrow, place[i], place[j], float(chain.transitions[i, j]))
    for k, x in place.items():
        goals = [j for i, j in row.leaving if i == k]
        _draw_leaving(axes, x, row.top, {j: float(chain.transitions[k, j]) for j in goals})
        if chain.initial[k] >= 0.005:  # what would be shown as 0.00 is not
            _draw_beginning(axes, x, row.foot, float(chain.initial[k]))


def _draw_leaving(axes: Axes, x: int, top: float, goals: dict[int, float]) -> None:
    """Arrows from a node upwards, past all others, to nodes of other rows: one above the other, named."""
    for n, (goal, probability) in enumerate(goals.items()):
        tip = top + LINE * n
        arrow = FancyArrowPatch((x, RADIUS), (x, tip), shrinkA=0.0, shrinkB=0.0, zorder=2)
        arrow.set_arrowstyle("-|>")
        arrow.set_mutation_scale(11.0)
        arrow.set(color="0.35", linewidth=0.6 + 2.0 * probability)
        axes.add_patch(arrow)
        text = axes.text(x + 0.08, tip - 0.06, f"to {goal}: {probability:.2f}", fontsize=SMALL, zorder=5)
        halo(text).set(ha="left", va="center")


def _draw_node(axes: Axes, x: int, state: int, *, final: bool) -> Circle:
    """The node, whose outline is where arrows end."""
    axes.add_patch(Circle((x, 0.0), RADIUS, color=state_colour(state), zorder=3, gid=f"state {state}"))
    if state_dash(state) != "-":  # the colour is that of another state too
        dashes = Circle((x, 0.0), 0.82 * RADIUS, fill=False, edgecolor="white", linestyle=state_dash(state))
        dashes.set(linewidth=1.8, zorder=4)
        axes.add_patch(dashes)
    if final:
        ring = Circle((x, 0.0), RING, fill=False, edgecolor=state_colour(state), linewidth=1.6)
        axes.add_patch(ring)
    text = axes.text(x, 0.0, str(state), color="white", fontsize="large", fontweight="bold", zorder=5)
    text.set(ha="center", va="center", path_effects=[withStroke(linewidth=2.0, foreground="black")])
    outline = Circle((x, 0.0), RING if final else RADIUS, visible=False)
    axes.add_patch(outline)
    return outline


def _draw_arrow(axes: Axes, arrow: FancyArrowPatch, x: int, goal: int, probability: float) -> None:
    peak = _peak(x, goal)
    arrow.set_connectionstyle("arc3", rad=-2.0 * peak / (goal - x))  # its top lies at half of rad times span
    arrow.set_arrowstyle("-|>")
    arrow.set_mutation_scale(11.0)
    arrow.set(color="0.35", linewidth=0.6 + 2.0 * probability)
    axes.add_patch(arrow)
    above = peak + (0.11 if goal > x else -0.11)
    label = axes.text(0.5 * (x + goal), above, f"{probability:.2f}", fontsize=SMALL, zorder=5)
    halo(label).set(ha="center", va="center")


def _draw_beginning(axes: Axes, x: int, foot: float, probability: float) -> None:
    """An arrow from nowhere, below all others, into a first state."""
    arrow = {"arrowstyle": "-|>", "color": "0.35", "linewidth": 0.6 + 2.0 * probability}
    axes.annotate("", (x, -RADIUS), (x, foot), arrowprops=arrow)
    axes.text(x + 0.06, foot, f"begins {probability:.2f}", fontsize=SMALL, ha="left", va="center")


def _draw_durations(
    figure: Figure,
    cells: SubplotSpec,
    chain: SemiMarkovChain,
    line: Int[Array, " L"],
    breadth: int,
    period: float,
) -> None:
    """How probable each duration is, state by state, on the same scales for all states of the skill."""
    longest = chain.durations.longest(OUT_OF_SIGHT)
    density = np.exp(chain.durations.log_table(longest)) / period  # (S, K), per second
    seconds = period * np.arange(1, longest + 1)
    row = cells.subgridspec(1, breadth, wspace=0.08)
    for x, k in enumerate(line):
        axes = figure.add_subplot(row[0, x])
        colour, dash = state_colour(int(k)), state_dash(int(k))
        axes.fill_between(seconds, density[:, k], color=colour, alpha=0.3)
        axes.plot(seconds, density[:, k], color=colour, linestyle=dash, linewidth=1.8)
        axes.set(xlim=(0.0, seconds[-1]), ylim=(0.0, 1.05 * density.max()))
        dress(axes, x="duration [s]", y="" if x else "density [1/s]").tick_params(labelleft=x == 0)
        mean, deviation = period * chain.durations.means[k], period * chain.durations.deviations[k]
        # two that count; visits that all last as long have no deviation
        digits = max(0, 1 - int(np.floor(np.log10(deviation or period))))
        axes.set_title(f"{mean:.{digits}f} ± {deviation:.{digits}f} s", fontsize=SMALL + 1)
