"""A semi-Markov skill as a graph: which state follows which, and how long each lasts."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import withStroke

from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, SemiMarkovChain, Skill, log_duration_table, longest_duration, occupancy
from pilotfish.plots.doors import require_states
from pilotfish.plots.style import SMALL, dress, sheet, state_colour
from pilotfish.types import Array, Int

RADIUS = 0.27  # of a node; nodes stand one apart
RING = RADIUS + 0.06  # around a final node
RISE = 0.22  # how much higher an arrow climbs for each further node it passes over


def state_graph(skill: Skill | AdaptedSkill, *, least: float = 0.01) -> Figure:
    """States from left to right in the order of their time, transitions as arrows, durations under each state.

    Arrows onward run above, arrows back below; those less probable than least are left out. A double ring is
    a final state, an arrow from nowhere tells how probable it is to begin there. Under each state: how
    probable it is that a visit lasts so long, and mean and deviation of that Gaussian [s].
    Raises: InvalidInput, when the skill is not semi-Markov, has too many states or least is no probability.
    Source: after Tanwani 2018, figure 3.6.
    """
    chain = skill.dynamics
    if not isinstance(chain, SemiMarkovChain):
        raise InvalidInput(f"the skill has {type(chain).__name__}, expected a SemiMarkovChain: learn makes one")
    if not 0.0 <= least <= 1.0:
        raise InvalidInput(f"least is {least}, expected a probability such as .01")
    K = skill.states
    require_states(K)
    order = _in_time(chain)
    figure = sheet(max(5.0, 1.42 * K + 0.8), 4.6)
    rows = figure.add_gridspec(2, 1, height_ratios=(1.25, 1.0))
    _draw_graph(figure.add_subplot(rows[0]), chain, order, least)
    _draw_durations(figure, rows[1], chain, order, skill.period)
    return figure


def _in_time(chain: SemiMarkovChain) -> Int[Array, " K"]:
    """States by the average time at which the skill is in them; those never reached come last."""
    horizon = int(np.ceil(chain.durations.means.sum())) + 1
    shares = occupancy(chain, np.empty((0, len(chain.initial))), horizon)  # (T, K)
    mass = shares.sum(axis=0)
    times = np.divide(np.arange(horizon) @ shares, mass, out=np.full(len(mass), np.inf), where=mass > 0.0)
    return np.argsort(times, kind="stable")


def _draw_graph(axes: Axes, chain: SemiMarkovChain, order: Int[Array, " K"], least: float) -> None:
    final = ~chain.transitions.any(axis=1)
    nodes = {int(k): _draw_node(axes, x, int(k), final=bool(final[k])) for x, k in enumerate(order)}
    reach = [RING, -RING]  # how far up and down the drawing goes
    for i, j in np.argwhere((chain.transitions >= least) & (chain.transitions > 0.0)):
        reach.append(_draw_arrow(axes, nodes[int(i)], nodes[int(j)], float(chain.transitions[i, j])))
    for k, node in nodes.items():
        if chain.initial[k] >= least and chain.initial[k] > 0.0:
            reach.append(_draw_beginning(axes, node, float(chain.initial[k])))
    axes.set_xlim(-0.5, len(order) - 0.5)
    axes.set_ylim(min(reach) - 0.2, max(reach) + 0.2)
    axes.set_aspect("equal")
    axes.axis("off")


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


def _draw_arrow(axes: Axes, start: Circle, end: Circle, probability: float) -> float:
    """The arrow and its probability; returns how high it climbs, negative if it hangs below."""
    (x, _), (goal, _) = start.get_center(), end.get_center()
    span, side = abs(goal - x), np.sign(goal - x)
    height = 0.0 if goal - x == 1 else RING + 0.1 + RISE * (span - 1)
    arrow = FancyArrowPatch(
        (x, 0.0),
        (goal, 0.0),
        connectionstyle=f"arc3,rad={-2.0 * height / span:.4f}",  # the top of arc3 lies at half of rad times span
        arrowstyle="-|>",
        mutation_scale=11.0,
        linewidth=0.6 + 2.0 * probability,
        color="0.35",
        patchA=start,
        patchB=end,
        zorder=2,
    )
    axes.add_patch(arrow)
    label = axes.text(0.5 * (x + goal), side * (height + 0.11), f"{probability:.2f}", fontsize=SMALL)
    label.set(ha="center", va="center")
    return float(side * (height + 0.11))


def _draw_beginning(axes: Axes, node: Circle, probability: float) -> float:
    """An arrow from nowhere into a first state; returns how low it hangs."""
    x, low = node.get_center()[0], -RING - 0.42
    arrow = {"arrowstyle": "-|>", "color": "0.35", "linewidth": 0.6 + 2.0 * probability}
    axes.annotate("", (x, -RADIUS), (x, low), arrowprops=arrow)
    axes.text(x + 0.08, low + 0.1, f"begins {probability:.2f}", fontsize=SMALL, ha="left", va="center")
    return low


def _draw_durations(
    figure: Figure, cells: SubplotSpec, chain: SemiMarkovChain, order: Int[Array, " K"], period: float
) -> None:
    """How probable each duration is, state by state, all on the same scales."""
    longest = longest_duration(chain.durations)
    density = np.exp(log_duration_table(chain.durations, longest)) / period  # (S, K), per second
    seconds = period * np.arange(1, longest + 1)
    first: Axes | None = None
    for cell, k in zip(cells.subgridspec(1, len(order), wspace=0.08), order, strict=True):
        axes = figure.add_subplot(cell, sharex=first, sharey=first)
        axes.fill_between(seconds, density[:, k], color=state_colour(int(k)), alpha=0.3)
        axes.plot(seconds, density[:, k], color=state_colour(int(k)), linewidth=1.8)
        dress(axes, x="duration [s]", y="" if first else "density [1/s]")
        mean, deviation = period * chain.durations.means[k], period * chain.durations.deviations[k]
        axes.set_title(f"{mean:.2g} ± {deviation:.2g} s", fontsize=SMALL + 1)
        axes.tick_params(labelleft=first is None)
        first = first or axes
    if first is not None:
        first.set_xlim(0.0, seconds[-1])
        first.set_ylim(0.0, None)
