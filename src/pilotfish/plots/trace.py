"""How a fit went: the likelihood along the iterations."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pilotfish.errors import InvalidInput
from pilotfish.models import Fit
from pilotfish.plots.kinds import require_sequence
from pilotfish.plots.style import COLUMN_COLOURS, legend_below, new_figure, style_axes


def likelihood_trace(fits: Sequence[Fit]) -> Figure:
    """Log-likelihood of the demonstrations before each iteration, a line for each fit.

    Raises: InvalidInput, when there are no fits, or more than can be told apart.
    """
    require_sequence("fits", fits, Fit)
    if not 1 <= len(fits) <= len(COLUMN_COLOURS):
        raise InvalidInput(f"{len(fits)} fits were given, expected 1 to {len(COLUMN_COLOURS)}")
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
