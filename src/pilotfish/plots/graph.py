"""A semi-Markov skill as a graph: which state follows which, and how long each lasts."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch
from matplotlib.patheffects import withStroke

from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, SemiMarkovChain, Skill, log_duration_table, longest_duration, occupancy
from pilotfish.plots.doors import require_states
from pilotfish.plots.style import SMALL, dress, sheet, state_colour
from pilotfish.types import Array, Float, Int

RADIUS = 0.27  # of a node; nodes stand one apart
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
    _draw_durations(figure, rows[1].subgridspec(1, K, wspace=0.06), chain, order, skill.period)
    return figure


def _in_time(chain: SemiMarkovChain) -> Int[Array, " K"]:
    """States by the average time at which the skill is in them; those never reached come last."""
    horizon = int(np.ceil(chain.durations.means.sum())) + 1
    shares = occupancy(chain, np.empty((0, len(chain.initial))), horizon)  # (T, K)
    mass = shares.sum(axis=0)
    times = np.divide(np.arange(horizon) @ shares, mass, out=np.full(len(mass), np.inf), where=mass > 0.0)
    return np.argsort(times, kind="stable")


def _draw_graph(axes: Axes, chain: SemiMarkovChain, order: Int[Array, " K"], least: float) -> None:
    place = {int(state): x for x, state in enumerate(order)}
    heights = [_RING, -_RING]
    for i, j in np.argwhere(chain.transitions >= max(least, np.finfo(float).tiny)):
        heights.append(_draw_arrow(axes, place[int(i)], place[int(j)], float(chain.transitions[i, j])))
    for k, x in place.items():
        _draw_node(axes, x, k, final=not chain.transitions[k].any())
        if chain.initial[k] >= least:
            heights.append(_draw_beginning(axes, x, float(chain.initial[k])))
    axes.set_xlim(-0.75, len(order) - 0.25)
    axes.set_ylim(min(heights) - 0.2, max(heights) + 0.2)
    axes.set_aspect("equal")
    axes.axis("off")


_RING = RADIUS + 0.06


def _draw_node(axes: Axes, x: float, state: int, *, final: bool) -> None:
    axes.add_patch(Circle((x, 0.0), RADIUS, color=state_colour(state), zorder=3))
    if final:
        axes.add_patch(Circle((x, 0.0), _RING, fill=False, edgecolor=state_colour(state), linewidth=1.6))
    outline = [withStroke(linewidth=2.0, foreground="black")]
    text = axes.text(x, 0.0, str(state), color="white", fontsize="large", fontweight="bold", zorder=4)
    text.set(ha="center", va="center_baseline", path_effects=outline)


def _draw_arrow(axes: Axes, start: int, end: int, probability: float) -> float:
    """The arrow and its probability; returns how high it climbs, negative if it hangs below."""
    span = abs(end - start)
    height = 0.0 if end - start == 1 else _RING + 0.1 + RISE * (span - 1)
    side = 1.0 if end > start else -1.0
    width = 0.6 + 2.4 * probability
    arrow = FancyArrowPatch(
        (start, 0.0),
        (end, 0.0),
        connectionstyle=f"arc3,rad={-2.0 * height / span:.4f}",  # the top of arc3 lies at half of rad times span
        arrowstyle="-|>",
        mutation_scale=8 + 4 * width,
        linewidth=width,
        color="0.35",
        shrinkA=0.0,
        shrinkB=0.0,
        zorder=1,
    )
    arrow.set_clip_on(False)
    axes.add_patch(arrow)
    peak = side * height
    axes.text(0.5 * (start + end), peak + 0.1 * side, f"{probability:.2f}", fontsize=SMALL, ha="center", va="center")
    return peak


def _draw_beginning(axes: Axes, x: float, probability: float) -> float:
    """An arrow from nowhere into a first state; returns how low it hangs."""
    low = -_RING - 0.42
    axes.annotate(
        "", (x, -RADIUS), (x, low), arrowprops={"arrowstyle": "-|>", "color": "0.35", "linewidth": 1.5}
    )
    axes.text(x + 0.07, low + 0.1, f"begins: {probability:.2f}", fontsize=SMALL, ha="left", va="center")
    return low
