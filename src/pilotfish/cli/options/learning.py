"""Options shared by commands that learn skills or draw random numbers."""

import click

from pilotfish.cli.output.results import require_finite_option

regularisation_option = click.option(
    "--regularisation",
    type=click.FloatRange(min=0.0),
    callback=require_finite_option,
    help="Variance added to each column of every covariance [unit squared].  [default: from the scales of "
    "the demonstrations, for each column]",
)
seed_option = click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the random number generator.",
)
