"""Plot of the log-likelihood of fits over the iterations of EM."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pilotfish.errors import InvalidInput
from pilotfish.models import Fit
from pilotfish.plots.style import COLUMN_COLOURS, legend_below, new_figure, style_axes
from pilotfish.plots.validation import require_sequence


def likelihood_trace(fits: Sequence[Fit]) -> Figure:
    """Plot the log-likelihood before each iteration, one line per fit.

    Args:
        fits: Fits, at most as many as there are colours.

    Returns:
        The figure.

    Raises:
        InvalidInput: If fits is empty or too long.
    """
    require_sequence("fits", fits, Fit)
    if not 1 <= len(fits) <= len(COLUMN_COLOURS):
        raise InvalidInput(f"fits has {len(fits)} entries, expected 1 to {len(COLUMN_COLOURS)}")
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    for fit, colour in zip(fits, COLUMN_COLOURS, strict=False):
        status = "converged" if fit.convergence.converged else "not converged"
        label = f"{fit.skill.provenance.structure}, {status} after {fit.convergence.iterations}"
        axes.plot(
            range(len(fit.log_likelihoods)),
            fit.log_likelihoods,
            color=colour,
            marker="o",
            markersize=3.5,
            label=label,
        )
    style_axes(axes, x="iteration", y="log-likelihood [nat]")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend_below(figure, axes.get_lines())
    return figure
