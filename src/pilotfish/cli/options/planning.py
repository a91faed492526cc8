"""Options of the planner, shared by `reproduce` and `perform`."""

from collections.abc import Callable
from typing import Any

import click

from pilotfish.cli.output.results import require_finite_option
from pilotfish.models import MAX_HORIZON

Command = Callable[..., Any]
PLANNING_OPTIONS = (
    click.option(
        "--horizon",
        type=click.IntRange(2, MAX_HORIZON),
        help="Number of steps of the motion.  [default: mean length of the demonstrations]",
    ),
    click.option(
        "--control-cost",
        type=click.FloatRange(min=0.0, min_open=True),
        callback=require_finite_option,
        help="Cost of squared acceleration, the same for every column; a larger value gives lower gains and "
        "a smoother motion.  [default: from the scales of the skill, for each column]",
    ),
    click.option(
        "--covariance-regularisation",
        type=click.FloatRange(min=0.0),
        callback=require_finite_option,
        help="Variance added to the planned covariances before they are inverted to weights [unit squared].  "
        "[default: a thousandth of the scale of each column, squared]",
    ),
)


def planning_options(command: Command) -> Command:
    """Add --horizon, --control-cost and --covariance-regularisation to a command."""
    for option in reversed(PLANNING_OPTIONS):
        command = option(command)
    return command
