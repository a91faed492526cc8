"""A semi-Markov skill as a graph: which state follows which, and how long each lasts."""

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
    log_duration_table,
    longest_duration,
    occupancy,
)
from pilotfish.plots.doors import require_states
from pilotfish.plots.style import SMALL, dress, halo, sheet, state_colour
from pilotfish.types import Array, Int

UNIT = 1.35  # inches between nodes
RADIUS = 0.27  # of a node; nodes stand one apart
RING = RADIUS + 0.06  # around a final node
RISE = 0.22  # how much higher an arrow climbs for each further node it passes over


def state_graph(skill: Skill | AdaptedSkill, *, least: float = 0.01) -> Figure:
    """States from left to right in order of time, transitions as arrows, and durations under each state.

    Arrows onward run above, arrows back below; those less probable than least are left out. A double ring is
    a final state, an arrow from nowhere tells how probable it is to begin there. Under each state: how
    probable it is that a visit lasts so long, and mean and deviation of that Gaussian [s].
    Raises: InvalidInput, when the skill is not semi-Markov, has too many states or least is no probability.
    Source: after Tanwani 2018, figure 3.6.
    """
    chain = skill.dynamics
    if not isinstance(chain, SemiMarkovChain):
        raise InvalidInput(
            f"the skill has {type(chain).__name__}, expected a SemiMarkovChain: learn makes one"
        )
    if not 0.0 <= least <= 1.0:
        raise InvalidInput(f"least is {least}, expected a probability such as .01")
    K = skill.states
    require_states(K)
    order = _in_time(chain)
    place = {int(state): x for x, state in enumerate(order)}
    arrows = [
        (int(i), int(j)) for i, j in np.argwhere((chain.transitions >= least) & (chain.transitions > 0.0))
    ]
    peaks = [_peak(place[i], place[j]) for i, j in arrows]
    foot, high = min([-RING - 0.2, *peaks]) - 0.2, max([RING, *peaks]) + 0.2
    low = foot - 0.12
    figure = sheet(max(5.0, UNIT * K + 0.8), UNIT * (high - low) + 2.2)
    rows = figure.add_gridspec(2, 1, height_ratios=(UNIT * (high - low), 2.2))
    graph = figure.add_subplot(rows[0])
    graph.set(xlim=(-0.5, K - 0.5), ylim=(low, high), aspect="equal")
    graph.axis("off")
    _draw_graph(graph, chain, place, arrows, foot)
    _draw_durations(figure, rows[1], chain, order, skill.period)
    return figure


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


def _draw_graph(
    axes: Axes, chain: SemiMarkovChain, place: dict[int, int], arrows: list[tuple[int, int]], foot: float
) -> None:
    final = np.asarray(~chain.transitions.any(axis=1))
    nodes = {k: _draw_node(axes, x, k, final=bool(final[k])) for k, x in place.items()}
    for i, j in arrows:
        arrow = FancyArrowPatch((place[i], 0.0), (place[j], 0.0), patchA=nodes[i], patchB=nodes[j], zorder=2)
        _draw_arrow(axes, arrow, place[i], place[j], float(chain.transitions[i, j]))
    for k in np.flatnonzero(chain.initial >= 0.005):  # what would be shown as 0.00 is not
        _draw_beginning(axes, place[int(k)], foot, float(chain.initial[k]))


def _draw_node(axes: Axes, x: int, state: int, *, final: bool) -> Circle:
    """The node, whose outline is where arrows end."""
    axes.add_patch(Circle((x, 0.0), RADIUS, color=state_colour(state), zorder=3, gid=f"state {state}"))
    if final:
        ring = Circle((x, 0.0), RING, fill=False, edgecolor=state_colour(state), linewidth=1.6)
        axes.add_patch(ring)
    text = axes.text(x, 0.0, str(state), color="white", fontsize="large", fontweight="bold", zorder=4)
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
    figure: Figure, cells: SubplotSpec, chain: SemiMarkovChain, order: Int[Array, " K"], period: float
) -> None:
    """How probable each duration is, state by state, all on the same scales."""
    longest = longest_duration(chain.durations)
    density = np.exp(log_duration_table(chain.durations, longest)) / period  # (S, K), per second
    seconds = period * np.arange(1, longest + 1)
    first: Axes | None = None
    row = cells.subgridspec(1, len(order), wspace=0.08)
    for x, k in enumerate(order):
        axes = figure.add_subplot(row[0, x], sharex=first, sharey=first)
        axes.fill_between(seconds, density[:, k], color=state_colour(int(k)), alpha=0.3)
        axes.plot(seconds, density[:, k], color=state_colour(int(k)), linewidth=1.8)
        dress(axes, x="duration [s]", y="" if first else "density [1/s]")
        mean, deviation = period * chain.durations.means[k], period * chain.durations.deviations[k]
        digits = max(0, 1 - int(np.floor(np.log10(deviation))))  # two that count
        axes.set_title(f"{mean:.{digits}f} ± {deviation:.{digits}f} s", fontsize=SMALL + 1)
        axes.tick_params(labelleft=first is None)
        first = first or axes
    if first is not None:
        first.set_xlim(0.0, seconds[-1])
        first.set_ylim(0.0, None)
