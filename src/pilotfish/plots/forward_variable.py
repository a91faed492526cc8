"""Plot of the state probabilities of a semi-Markov skill over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, SemiMarkovChain, Skill
from pilotfish.plots.style import (
    FIGURE_WIDTH,
    legend_below,
    new_figure,
    state_colour,
    state_dash,
    state_legend_handles,
    style_axes,
)
from pilotfish.plots.validation import require_array, require_integer, require_states, require_type
from pilotfish.types import Array, Float

NO_END_TEXT = "final state: no segment ends"


def forward_variable(
    skill: Skill | AdaptedSkill, *, horizon: int, log_observed: Float[Array, "S K"] | None = None
) -> Figure:
    """Plot filtered state probabilities over time, and below them the rescaled forward variable.

    The state probability is what a plan follows. The rescaled forward variable h_t,i is the probability that
    a segment of state i ends at t, given that some segment does; a final state is never left and has none.

    Args:
        skill: Skill with semi-Markov dynamics.
        horizon: Number of steps.
        log_observed: log p(x_t | state i) for the first S steps; None for no observation.

    Returns:
        The figure.

    Raises:
        InvalidInput: If the skill is not semi-Markov, has too many states, or horizon is too short.

    Source:
        After Tanwani 2018, figure 3.6 and equations 3.40-3.42.
    """
    require_type("skill", skill, Skill, AdaptedSkill)
    require_integer("horizon", horizon)
    if log_observed is not None:
        require_array(
            "log_observed", log_observed, "S K", np.floating, "AdaptedSkill.log_state_likelihoods makes one"
        )
    chain = skill.dynamics
    if not isinstance(chain, SemiMarkovChain):
        raise InvalidInput(
            f"the skill has {type(chain).__name__}, expected a SemiMarkovChain: learn makes one"
        )
    require_states(skill.states)
    if log_observed is None:
        log_observed = np.empty((0, skill.states))
    log_segment_ends, log_forward = chain.forward(log_observed, horizon)
    figure = new_figure(FIGURE_WIDTH, 5.2)
    above, below = figure.subplots(2, 1, sharex=True)
    seconds = skill.period * np.arange(horizon)
    for axes, log_p in ((above, log_forward), (below, log_segment_ends)):
        _draw_probabilities(axes, seconds, _normalise_rows(log_p))
    style_axes(above, x="time [s]", y="probability [1]", title="state probability")
    style_axes(below, x="time [s]", y="probability [1]", title="a segment ends (rescaled forward variable)")
    above.set_xlabel("")
    if not chain.transitions.any():
        note = below.text(0.5, 0.5, NO_END_TEXT, transform=below.transAxes, color="0.35")
        note.set(ha="center", va="center")
    legend_below(figure, state_legend_handles(skill.states))
    return figure


def _normalise_rows(log_p: Float[Array, "T K"]) -> Float[Array, "T K"]:
    """Normalise rows to sum to one; a row of zero probability is nan, so that nothing is drawn."""
    total = np.logaddexp.reduce(log_p, axis=1)
    total[np.isneginf(total)] = np.nan
    return np.asarray(np.exp(log_p - total[:, None]))


def _draw_probabilities(axes: Axes, seconds: Float[Array, " T"], probabilities: Float[Array, "T K"]) -> None:
    for k, probability in enumerate(probabilities.T):
        style = {"color": state_colour(k), "linestyle": state_dash(k)}
        axes.plot(seconds, probability, linewidth=2.0, color=style["color"], linestyle=style["linestyle"])
        axes.fill_between(seconds, probability, color=style["color"], alpha=0.15, linewidth=0.0)
    axes.set_ylim(0.0, 1.04)
    axes.set_xlim(0.0, seconds[-1] if len(seconds) > 1 else 1.0)
