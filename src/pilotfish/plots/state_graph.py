"""Plot of a semi-Markov skill as a graph with its duration distributions."""

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
)
from pilotfish.plots.style import SMALL_FONT, add_outline, new_figure, state_colour, state_dash, style_axes
from pilotfish.plots.validation import require_number, require_states, require_type
from pilotfish.types import Array, Int

NODE_SPACING = 1.35  # inches between nodes
NODE_RADIUS = 0.27  # in units of the node spacing
FINAL_RING_RADIUS = NODE_RADIUS + 0.06  # around a final node
ARROW_RISE = 0.22  # height of an arrow per node that it passes
LINE_HEIGHT = 0.2  # between labels of targets in other rows
MAX_STATES_PER_ROW, ROW_MARGIN = 10, 1  # margin in nodes at the end of a row, if there are several
DURATION_PANEL_HEIGHT = 2.2  # inches
TAIL_PROBABILITY = 1e-4  # of durations beyond the drawn range


def state_graph(skill: Skill | AdaptedSkill, *, min_probability: float = 0.01) -> Figure:
    """Plot states in order of time, transitions as arrows, and duration distributions under each state.

    Many states fill several rows; an arrow to another row points up and names its target. Arrows within a
    row run above if they lead forward and below if back. A double ring is a final state; an arrow from below
    gives the initial probability. Under each state is the density of its durations, with mean and standard
    deviation [s].

    Args:
        skill: Skill with semi-Markov dynamics.
        min_probability: Smallest transition probability that is drawn.

    Returns:
        The figure.

    Raises:
        InvalidInput: If the skill is not semi-Markov, has too many states, or min_probability is not from 0
            to 1.

    Source:
        After Tanwani 2018, figure 3.6.
    """
    require_type("skill", skill, Skill, AdaptedSkill)
    require_number("min_probability", min_probability)
    chain = skill.dynamics
    if not isinstance(chain, SemiMarkovChain):
        raise InvalidInput(
            f"the skill has {type(chain).__name__}, expected a SemiMarkovChain: learn makes one"
        )
    if not 0.0 <= min_probability <= 1.0:
        raise InvalidInput(f"min_probability is {min_probability}, expected a probability such as 0.01")
    require_states(skill.states)
    lines = _split_into_rows(_order_by_time(chain))
    arrows = [
        (int(i), int(j))
        for i, j in np.argwhere((chain.transitions >= min_probability) & (chain.transitions > 0.0))
    ]
    positions = [{int(state): x for x, state in enumerate(line)} for line in lines]
    extents = [_vertical_extent(position, arrows) for position in positions]
    heights = [part for low, high in extents for part in (NODE_SPACING * (high - low), DURATION_PANEL_HEIGHT)]
    n_columns = len(lines[0]) + ROW_MARGIN * (len(lines) > 1)
    figure = new_figure(max(5.0, NODE_SPACING * n_columns + 0.8), sum(heights))
    cells = figure.add_gridspec(2 * len(lines), 1, height_ratios=heights)
    for n, position in enumerate(positions):
        graph = figure.add_subplot(cells[2 * n])
        graph.set(xlim=(-0.5, n_columns - 0.5), ylim=extents[n], aspect="equal")
        graph.axis("off")
        _draw_graph(graph, chain, position, arrows)
        _draw_durations(figure, cells[2 * n + 1], chain, lines[n], n_columns, skill.period)
    return figure


def _split_into_rows(order: Int[Array, " K"]) -> list[Int[Array, " L"]]:
    """Split the states into rows of equal length, except the last, that fit a page."""
    length = ceil(len(order) / ceil(len(order) / MAX_STATES_PER_ROW))
    return [order[n : n + length] for n in range(0, len(order), length)]


def _arrow_extent(position: dict[int, int], arrows: list[tuple[int, int]]) -> tuple[float, float]:
    """Return the lowest and the highest point of the arrows within a row."""
    peaks = [_arrow_peak(position[i], position[j]) for i, j in arrows if i in position and j in position]
    return min([-FINAL_RING_RADIUS - 0.2, *peaks]) - 0.2, max([FINAL_RING_RADIUS, *peaks]) + 0.2


def _vertical_extent(position: dict[int, int], arrows: list[tuple[int, int]]) -> tuple[float, float]:
    """Return the lowest and the highest point of a row, with the labels of arrows to other rows."""
    bottom, top = _arrow_extent(position, arrows)
    count = max(sum(i == k and j not in position for i, j in arrows) for k in position)
    return bottom - 0.12, top + LINE_HEIGHT * count


def _order_by_time(chain: SemiMarkovChain) -> Int[Array, " K"]:
    """Order states by their mean time; unreachable ones come last."""
    horizon = int(np.ceil(chain.durations.means.sum())) + 1
    probabilities = chain.filtered_state_probs(np.empty((0, len(chain.initial))), horizon)  # (T, K)
    expected_steps = probabilities.sum(axis=0)
    times = np.divide(
        np.arange(horizon) @ probabilities,
        expected_steps,
        out=np.full(len(expected_steps), np.inf),
        where=expected_steps > 0.0,
    )
    return np.argsort(times, kind="stable")


def _arrow_peak(start: int, end: int) -> float:
    """Return the height of an arrow between two positions; negative if it leads back."""
    distance = end - start
    return (
        0.0
        if distance == 1
        else float(np.sign(distance)) * (FINAL_RING_RADIUS + 0.1 + ARROW_RISE * (abs(distance) - 1))
    )


def _draw_graph(
    axes: Axes, chain: SemiMarkovChain, position: dict[int, int], arrows: list[tuple[int, int]]
) -> None:
    """Draw the states of a row and their arrows."""
    final, (bottom, top) = np.asarray(~chain.transitions.any(axis=1)), _arrow_extent(position, arrows)
    nodes = {k: _draw_node(axes, x, k, final=bool(final[k])) for k, x in position.items()}
    for i, j in arrows:
        if i in position and j in position:
            arrow = FancyArrowPatch(
                (position[i], 0.0), (position[j], 0.0), patchA=nodes[i], patchB=nodes[j], zorder=2
            )
            _draw_arrow(axes, arrow, position[i], position[j], float(chain.transitions[i, j]))
    for k, x in position.items():
        targets = [j for i, j in arrows if i == k and j not in position]
        _draw_outgoing_arrows(axes, x, top, {j: float(chain.transitions[k, j]) for j in targets})
        if chain.initial[k] >= 0.005:  # omit 0.00
            _draw_initial_arrow(axes, x, bottom, float(chain.initial[k]))


def _draw_outgoing_arrows(axes: Axes, x: int, arrow_top: float, targets: dict[int, float]) -> None:
    """Draw arrows from a node upward to targets in other rows, one above the other, with labels."""
    for n, (target, probability) in enumerate(targets.items()):
        tip = arrow_top + LINE_HEIGHT * n
        arrow = FancyArrowPatch((x, NODE_RADIUS), (x, tip), shrinkA=0.0, shrinkB=0.0, zorder=2)
        arrow.set_arrowstyle("-|>")
        arrow.set_mutation_scale(11.0)
        arrow.set(color="0.35", linewidth=0.6 + 2.0 * probability)
        axes.add_patch(arrow)
        text = axes.text(
            x + 0.08, tip - 0.06, f"to {target}: {probability:.2f}", fontsize=SMALL_FONT, zorder=5
        )
        add_outline(text).set(ha="left", va="center")


def _draw_node(axes: Axes, x: int, state: int, *, final: bool) -> Circle:
    """Draw a node, and return the outline at which arrows end."""
    axes.add_patch(Circle((x, 0.0), NODE_RADIUS, color=state_colour(state), zorder=3, gid=f"state {state}"))
    if state_dash(state) != "-":  # the colour is used twice
        dashes = Circle(
            (x, 0.0), 0.82 * NODE_RADIUS, fill=False, edgecolor="white", linestyle=state_dash(state)
        )
        dashes.set(linewidth=1.8, zorder=4)
        axes.add_patch(dashes)
    if final:
        ring = Circle((x, 0.0), FINAL_RING_RADIUS, fill=False, edgecolor=state_colour(state), linewidth=1.6)
        axes.add_patch(ring)
    text = axes.text(x, 0.0, str(state), color="white", fontsize="large", fontweight="bold", zorder=5)
    text.set(ha="center", va="center", path_effects=[withStroke(linewidth=2.0, foreground="black")])
    outline = Circle((x, 0.0), FINAL_RING_RADIUS if final else NODE_RADIUS, visible=False)
    axes.add_patch(outline)
    return outline


def _draw_arrow(axes: Axes, arrow: FancyArrowPatch, x: int, target: int, probability: float) -> None:
    peak = _arrow_peak(x, target)
    arrow.set_connectionstyle(
        "arc3", rad=-2.0 * peak / (target - x)
    )  # the peak is half of rad times the distance
    arrow.set_arrowstyle("-|>")
    arrow.set_mutation_scale(11.0)
    arrow.set(color="0.35", linewidth=0.6 + 2.0 * probability)
    axes.add_patch(arrow)
    above = peak + (0.11 if target > x else -0.11)
    label = axes.text(0.5 * (x + target), above, f"{probability:.2f}", fontsize=SMALL_FONT, zorder=5)
    add_outline(label).set(ha="center", va="center")


def _draw_initial_arrow(axes: Axes, x: int, arrow_bottom: float, probability: float) -> None:
    """Draw the arrow of an initial probability, below all others."""
    arrow = {"arrowstyle": "-|>", "color": "0.35", "linewidth": 0.6 + 2.0 * probability}
    axes.annotate("", (x, -NODE_RADIUS), (x, arrow_bottom), arrowprops=arrow)
    axes.text(
        x + 0.06, arrow_bottom, f"initial {probability:.2f}", fontsize=SMALL_FONT, ha="left", va="center"
    )


def _draw_durations(
    figure: Figure,
    cells: SubplotSpec,
    chain: SemiMarkovChain,
    line: Int[Array, " L"],
    n_columns: int,
    period: float,
) -> None:
    """Draw the duration density of each state, with the same scales for all states."""
    max_duration = chain.durations.max_duration(TAIL_PROBABILITY)
    density = np.exp(chain.durations.log_table(max_duration)) / period  # (S, K), per second
    seconds = period * np.arange(1, max_duration + 1)
    row = cells.subgridspec(1, n_columns, wspace=0.08)
    for x, k in enumerate(line):
        axes = figure.add_subplot(row[0, x])
        colour, dash = state_colour(int(k)), state_dash(int(k))
        axes.fill_between(seconds, density[:, k], color=colour, alpha=0.3)
        axes.plot(seconds, density[:, k], color=colour, linestyle=dash, linewidth=1.8)
        axes.set(xlim=(0.0, seconds[-1]), ylim=(0.0, 1.05 * density.max()))
        style_axes(axes, x="duration [s]", y="" if x else "density [1/s]").tick_params(labelleft=x == 0)
        mean, deviation = period * chain.durations.means[k], period * chain.durations.deviations[k]
        # two significant digits; the deviation may be zero
        digits = max(0, 1 - int(np.floor(np.log10(deviation or period))))
        axes.set_title(f"{mean:.{digits}f} ± {deviation:.{digits}f} s", fontsize=SMALL_FONT + 1)
