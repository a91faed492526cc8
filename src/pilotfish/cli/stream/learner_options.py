"""Options of `pilotfish stream` that describe the online learner: penalties, scales and maintenance."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from math import isfinite
from typing import Any

import click

from pilotfish.cli.output.results import require_finite_option
from pilotfish.models import MAX_STATES, online

Command = Callable[..., Any]
Options = Mapping[str, Any]  # values of options by name; None if an option was not given

# Meaning of each penalty, in squared scales of the columns unless it says otherwise.
PENALTIES = {
    "cluster": "squared distance from which a datapoint starts a new cluster (lambda)",
    "dimension": "variance that an additional subspace direction must explain (lambda_1)",
    "transition": "cost of a transition per nat of its negative log-probability (lambda_2)",
    "new_transition": "cost of a transition that has not occurred before (lambda_3)",
    "noise": "variance outside the subspaces in the resulting skill (sigma^2)",
    "bandwidth": "squared distance from a mean at which the weight of a datapoint decays (b_m)",
}
DEFAULT_ZERO = {"sosc": ("transition", "new_transition")}  # penalties that need not be given
ZERO_ALLOWED = ("transition", "new_transition")
MAINTENANCE = tuple(field.name for field in fields(online.Maintenance))
SCALES = ("scale", "scales")
NAMES = ("learner", *PENALTIES, *SCALES, *MAINTENANCE)


LEARNER_OPTION = click.option(
    "--learner", type=click.Choice(tuple(online.LEARNERS)), help="Online learner.  [default: sosc]"
)


def parse_scales(_: click.Context, parameter: click.Parameter, value: str | None) -> tuple[float, ...] | None:
    """Return numbers that are separated by commas, or raise click.BadParameter."""
    if value is None:
        return None
    try:
        scales = tuple(map(float, value.split(",")))
    except ValueError:
        scales = ()
    if not scales or not all(isfinite(scale) and scale > 0.0 for scale in scales):
        raise click.BadParameter(
            f"{value!r} is not a list of positive numbers, such as 0.1,0.1,1.", param=parameter
        )
    return scales


SCALE_OPTIONS = (
    click.option(
        "--scale/--no-scale",
        default=None,
        help="Divide columns by scales estimated from the first rows or demonstrations. Penalties are then "
        "in squared scales; with --no-scale, in squared units of the columns.  [default: scale]",
    ),
    click.option(
        "--scales",
        metavar="NUMBERS",
        callback=parse_scales,
        help="Scale of each column, separated by commas, in place of estimated scales.",
    ),
)
MAINTENANCE_OPTIONS = (
    click.option(
        "--discount",
        type=click.FloatRange(0.0, 1.0, min_open=True, max_open=True),
        callback=require_finite_option,
        help="Factor on the weights of all clusters per datapoint, such as 0.995.  [default: no decay]",
    ),
    click.option(
        "--forget-below",
        type=click.FloatRange(0.0, 1.0, max_open=True),
        callback=require_finite_option,
        help="Weight below which a cluster is removed, with --discount.  [default: 0]",
    ),
    click.option(
        "--constant-weight",
        type=click.FloatRange(min=0.0, min_open=True),
        callback=require_finite_option,
        help="Weight of every cluster at all times [datapoints]; excludes --discount.",
    ),
    click.option(
        "--merge-distance",
        type=click.FloatRange(min=0.0),
        callback=require_finite_option,
        help="Distance between means below which two clusters are merged; 0 merges none.  "
        "[default: square root of --cluster]",
    ),
    click.option(
        "--extra-directions",
        type=click.IntRange(0, online.Maintenance.MAX_EXTRA_DIRECTIONS),
        help="Subspace directions that are tracked beyond the dimension.  [default: 1; 32 with estimated "
        "penalties]",
    ),
    click.option(
        "--max-clusters",
        type=click.IntRange(1, MAX_STATES),
        help="Maximum number of clusters; the lightest is removed for a new one.  [default: 256]",
    ),
    click.option(
        "--batch",
        type=click.IntRange(1, online.Maintenance.MAX_BATCH),
        help="Mini-batch size: datapoints assigned before subspaces are updated.  [default: 1]",
    ),
)


def learner_options(command: Command) -> Command:
    """Add the options named in NAMES to a command; a default of None means not given."""
    penalties = (_penalty_option(name, meaning) for name, meaning in PENALTIES.items())
    for option in reversed((LEARNER_OPTION, *penalties, *SCALE_OPTIONS, *MAINTENANCE_OPTIONS)):
        command = option(command)
    return command


def _penalty_option(name: str, meaning: str) -> Command:
    return click.option(
        option_name(name),
        type=click.FloatRange(min=0.0, min_open=name not in ZERO_ALLOWED),
        callback=require_finite_option,
        help=f"{meaning[0].upper()}{meaning[1:]}.",
    )


def option_name(name: str) -> str:
    """Return the option of a parameter: --forget-below for forget_below."""
    return f"--{name.replace('_', '-')}"


def given_options(options: Options, names: tuple[str, ...] = NAMES) -> list[str]:
    """Return the options that were given, in the form --forget-below."""
    return [option_name(name) for name in names if options[name] is not None]


def missing_penalties(options: Options) -> list[str]:
    """Return the penalties that the learner needs and that were not given.

    Args:
        options: Values of the options in NAMES.

    Raises:
        click.UsageError: If the learner does not have a penalty that was given.
    """
    learner = options["learner"] or "sosc"
    names = online.penalty_names(online.LEARNERS[learner])
    given = [name for name in PENALTIES if options[name] is not None]
    if unsupported := [name for name in given if name not in names]:
        raise click.UsageError(
            f"{option_name(unsupported[0])} is not an option of --learner {learner}, which has "
            f"{', '.join(map(option_name, names))}"
        )
    return [p for p in names if p not in given and p not in DEFAULT_ZERO.get(learner, ())]


def given_scales(options: Options) -> tuple[float, ...] | bool:
    """Return the scales of --scales, False for --no-scale, or True where they are estimated.

    Args:
        options: Values of the options in NAMES.

    Raises:
        click.UsageError: If scales are given together with --no-scale.
    """
    if options["scales"] and options["scale"] is False:
        raise click.UsageError("--scales and --no-scale exclude each other; omit one")
    return options["scales"] or options["scale"] is not False


def build_settings(
    options: Options, estimate: online.SOSC | None = None, scales: tuple[float, ...] | None = None
) -> online.OnlineSettings:
    """Build the settings of the online learner.

    Args:
        options: Values of the options in NAMES.
        estimate: Settings that supply the penalties that were not given, the scales and the maintenance; None
            if all penalties were given.
        scales: Scale of each column, without an estimate.

    Returns:
        Settings of the learner.
    """
    learner: type[Any] = online.LEARNERS[options["learner"] or "sosc"]
    names = online.penalty_names(learner)
    given = {name: options[name] for name in names if options[name] is not None}
    if estimate is None:
        settings: online.OnlineSettings = learner(
            **given, maintenance=build_maintenance(options), scales=scales
        )
        return settings
    penalties = {name: getattr(estimate, name) for name in names} | given
    estimated: online.OnlineSettings = learner(
        **penalties, maintenance=estimate.maintenance, scales=estimate.scales
    )
    return estimated


def build_maintenance(options: Options) -> online.Maintenance:
    """Build the maintenance settings, or raise click.UsageError if options exclude each other."""
    given = {name: options[name] for name in MAINTENANCE if options[name] is not None}
    if missing_penalties(options):
        given = {"extra_directions": online.ALL_DIRECTIONS.extra_directions} | given
    if given.get("forget_below") and "discount" not in given:
        raise click.UsageError("--forget-below needs --discount; without decay no weight falls below it")
    if "constant_weight" in given and "discount" in given:
        raise click.UsageError("--constant-weight and --discount exclude each other; omit one")
    return online.Maintenance(**given)
