"""The options of pilotfish stream that say what is learned, and how the past is kept."""

from collections.abc import Callable
from typing import Any

import click

from pilotfish.cli.output.answers import require_finite_option
from pilotfish.cli.stream.settings import LEARNERS, PENALTIES, WEIGHTINGS, option_name
from pilotfish.models import MAX_STATES, online

Command = Callable[..., Any]

ZERO_ALLOWED = ("transition", "new_transition")  # nothing, if one likes
WEIGHTING_OPTIONS = (
    click.option(
        "--weighting",
        type=click.Choice(WEIGHTINGS),
        help="What the past weighs: its datapoints, a trace that fades, or ever the same.  [default: count]",
    ),
    click.option(
        "--discount",
        type=click.FloatRange(0.0, 1.0, min_open=True, max_open=True),
        callback=require_finite_option,
        help="Of --weighting trace: what a weight keeps at every datapoint.  [default: 0.995]",
    ),
    click.option(
        "--forget-below",
        type=click.FloatRange(0.0, 1.0, max_open=True),
        callback=require_finite_option,
        help="Of --weighting trace: the weight below which a cluster is forgotten.  [default: 0]",
    ),
    click.option(
        "--weight",
        type=click.FloatRange(min=0.0, min_open=True),
        callback=require_finite_option,
        help="Of --weighting constant: what every cluster weighs [datapoints].",
    ),
)
MAINTENANCE_OPTIONS = (
    click.option(
        "--merge-distance",
        type=click.FloatRange(min=0.0),
        callback=require_finite_option,
        help="Clusters whose means are closer become one; 0 merges none.  [default: the root of --cluster]",
    ),
    click.option(
        "--extra-directions",
        type=click.IntRange(0, online.Maintenance.MAX_EXTRA_DIRECTIONS),
        help="Directions that a subspace remembers beyond its dimension.  [default: 1]",
    ),
    click.option(
        "--max-clusters",
        type=click.IntRange(1, MAX_STATES),
        help="The lightest cluster makes room for one more than these.  [default: 256]",
    ),
    click.option(
        "--batch",
        type=click.IntRange(1, online.Maintenance.MAX_BATCH),
        help="So many datapoints are assigned before one of them changes a subspace.  [default: 1]",
    ),
)


def learner_options(command: Command) -> Command:
    """The command with an option for every field of Wanted, none of which has a default."""
    learner = click.option(
        "--learner", type=click.Choice(tuple(LEARNERS)), help="What grows.  [default: sosc]"
    )
    penalties = (_penalty(name, meaning) for name, meaning in PENALTIES.items())
    for add in reversed((learner, *penalties, *WEIGHTING_OPTIONS, *MAINTENANCE_OPTIONS)):
        command = add(command)
    return command


def _penalty(name: str, meaning: str) -> Command:
    return click.option(
        option_name(name),
        type=click.FloatRange(min=0.0, min_open=name not in ZERO_ALLOWED),
        callback=require_finite_option,
        help=f"{meaning[0].upper()}{meaning[1:]}.",
    )
