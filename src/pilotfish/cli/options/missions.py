"""Options of `pilotfish mission`: link, agreement, envelope and situations, and what they are refused for."""

from collections.abc import Callable
from dataclasses import replace
from math import ceil, inf, isfinite, radians
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pilotfish.cli.options.execution import FILE, validate_film_path
from pilotfish.cli.output.results import require_finite_option

if TYPE_CHECKING:
    from pilotfish.simulation import MissionSettings
    from pilotfish.teleop import LinkSettings

Command = Callable[..., Any]
MODES = ("direct", "shared", "autonomous", "fixture")
DIRECTIONS = ("forward", "backward")
CM, PERCENT, KBIT, TENTHS = 100.0, 100.0, 1000.0, 10.0
MAX_BUDGET, MAX_ENVELOPE = 60.0, 120.0  # s
Outage = tuple[float, float, tuple[str, ...]]


def number_option(
    name: str, maximum: float, text: str, default: float | None = 0.0, minimum: float = 0.0
) -> Callable[[Command], Command]:
    """Return an option with a finite number.

    Args:
        name: Name with its dashes.
        maximum: Largest value.
        text: Help text.
        default: Default; None for none.
        minimum: Smallest value.
    """
    return click.option(
        name,
        type=click.FloatRange(minimum, maximum),
        callback=require_finite_option,
        default=default,
        show_default=default is not None,
        help=text,
    )


def _parse_rate(_: click.Context, parameter: click.Parameter, text: str | None) -> tuple[float, float]:
    """Return the rates of both directions [bit/s] of FORWARD[:BACKWARD] in kbit/s."""
    if text is None:
        return inf, inf
    try:
        rates = [float(part) for part in text.split(":")]
    except ValueError:
        rates = []
    if len(rates) not in (1, 2) or not all(isfinite(rate) and 1.0 <= rate <= 1e6 for rate in rates):
        raise click.BadParameter(
            f"{text!r} is not FORWARD or FORWARD:BACKWARD in kbit/s, such as 256:768.", param=parameter
        )
    return KBIT * rates[0], KBIT * rates[-1]


def _parse_outages(
    _: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> tuple[Outage, ...]:
    """Return start [s], duration [s] and directions of each START:DURATION[:DIRECTION]."""
    return tuple(_parse_outage(parameter, text) for text in texts)


def _parse_outage(parameter: click.Parameter, text: str) -> Outage:
    start, _, rest = text.partition(":")
    duration, separator, direction = rest.partition(":")
    try:
        numbers = float(start), float(duration)
    except ValueError:
        numbers = (-1.0, -1.0)
    is_possible = all(isfinite(number) and 0.0 <= number <= 1e6 for number in numbers)
    if not is_possible or (separator and direction not in DIRECTIONS):
        raise click.BadParameter(
            f"{text!r} is not START:DURATION in seconds, such as 20:10, or 20:10:forward or 20:10:backward.",
            param=parameter,
        )
    return *numbers, (direction,) if separator else DIRECTIONS


def _parse_modes(_: click.Context, parameter: click.Parameter, text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    modes = tuple(part.strip() for part in text.split(","))
    if unknown := [mode for mode in modes if mode not in MODES]:
        raise click.BadParameter(f"{unknown[0]!r} is not one of {', '.join(MODES)}.", param=parameter)
    return modes


OPTIONS = (
    click.option(
        "--mode",
        type=click.Choice(MODES),
        default="shared",
        show_default=True,
        help="Direct control, shared control (corrects the operator), autonomous control (takes over) or a "
        "virtual fixture (guides the robot along the path).",
    ),
    click.option(
        "--skill",
        type=FILE,
        help="Skill of the task.  [default: learned from six simulated demonstrations, kept in the cache]",
    ),
    number_option("--rtt", 60.0, "Round-trip time of the link, half of it in each direction [s].", 0.5),
    number_option("--jitter", 2.0, "Largest additional delay of each direction [s]."),
    number_option("--loss", 100.0, "Share of datagrams that are lost in each direction [%]."),
    number_option(
        "--burst", 1000.0, "Mean number of datagrams that are lost one after another.", 1.0, minimum=1.0
    ),
    click.option(
        "--rate",
        callback=_parse_rate,
        metavar="KBIT[:KBIT]",
        help="Rate to the robot and from the robot [kbit/s], such as 256:768.  [default: no limit]",
    ),
    click.option(
        "--outage",
        "outages",
        multiple=True,
        callback=_parse_outages,
        metavar="START:DURATION",
        help="Outage of the link [s], counted from the start of the session; with :forward or :backward, of "
        "one direction. Repeat the option for several.",
    ),
    number_option("--view-off", 100.0, "Distance by which the objects are displaced for the operator [cm]."),
    number_option("--view-turn", 180.0, "Angle by which they are turned about the vertical [degrees]."),
    number_option(
        "--budget",
        MAX_BUDGET,
        "Budget of the round trip on which both sites agree [s].  [default: that of the link]",
        None,
    ),
    number_option(
        "--allow-direct",
        MAX_BUDGET,
        "Longest budget with which the robot allows direct control [s].",
        0.5,
    ),
    number_option(
        "--allow-after-outage",
        MAX_ENVELOPE,
        "Time for which the robot may continue alone when the link is lost, near the demonstrations [s].",
        None,
    ),
    click.option(
        "--continue-from",
        callback=_parse_modes,
        metavar="MODES",
        help="Modes from which it may continue, separated by commas.  [default: that of --mode]",
    ),
    click.option(
        "--situations",
        type=click.IntRange(1, 10_000),
        default=1,
        show_default=True,
        help="Number of random situations.",
    ),
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        help="Seed of situations, link, keys and the simulated person.",
    ),
    click.option("--situation", type=click.IntRange(0, 9_999), help="Only the situation with this number."),
    click.option(
        "--out", type=FILE, help="Recording to write, as .mcap, of the first situation; see replay-session."
    ),
    click.option(
        "--film", type=FILE, callback=validate_film_path, help="Film to write, as .webp or .gif, of the same."
    ),
    click.option("--meshes", is_flag=True, help="Show the visual meshes of pilotfish[meshes] in the film."),
    click.option("--force", is_flag=True, help="Replace an existing recording and an existing film."),
)


def mission_options(command: Command) -> Command:
    """Add all options of a mission to a command."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


def mission_settings(options: dict[str, Any]) -> "MissionSettings":
    """Return the settings of a mission without an envelope.

    Args:
        options: Values of `mission_options`.

    Raises:
        click.UsageError: If options contradict each other, or the robot would refuse the mode.
    """
    from pilotfish.errors import InvalidInput
    from pilotfish.simulation import Link, MissionSettings
    from pilotfish.teleop import ContractLimits

    limits = ContractLimits(max_budget=MAX_BUDGET)
    budgets = {**limits.mode_budgets, "direct": options["allow_direct"]}
    try:
        settings = MissionSettings(
            mode=options["mode"],
            forward=_link(options, "forward", options["rate"][0]),
            backward=_link(options, "backward", options["rate"][1]),
            view=Link(0.0, options["view_off"] / CM, radians(options["view_turn"])),
            budget=options["budget"],
            contract=replace(limits, mode_budgets=budgets),
        )
    except InvalidInput as error:
        raise click.UsageError(_in_options(str(error))) from error
    _require_possible(settings, options)
    return settings


def _link(options: dict[str, Any], direction: str, rate: float) -> "LinkSettings":
    from pilotfish.teleop import LinkSettings

    outages = sorted(each[:2] for each in options["outages"] if direction in each[2])
    return LinkSettings(
        delay=options["rtt"] / 2.0,
        jitter=options["jitter"],
        loss=options["loss"] / PERCENT,
        mean_burst=options["burst"],
        rate=rate,
        outages=tuple(outages),
    )


def _in_options(message: str) -> str:
    """Return a message of the link in the names of the options."""
    return message.replace("mean_burst is", "--burst is").replace("outages[", "--outage [")


def _require_possible(settings: "MissionSettings", options: dict[str, Any]) -> None:
    """Refuse what the robot's site would refuse, before the mission begins."""
    mode, budget = settings.mode, settings.agreed_budget
    limit = settings.contract.mode_budgets[mode]
    if budget > limit and mode == "direct":
        raise click.UsageError(
            f"--mode direct is allowed with a budget of the round trip up to {limit:g} s, and it is "
            f"{budget:.2f} s here; use --mode shared, or --allow-direct {_round_up(budget)}"
        )
    if budget > limit:
        other = "autonomous" if budget <= settings.contract.mode_budgets["autonomous"] else None
        offer = f"use --mode {other}, or " if other and other != mode else ""
        raise click.UsageError(
            f"--mode {mode} is allowed with a budget of the round trip up to {limit:g} s, and it is "
            f"{budget:.2f} s here; {offer}shorten --rtt, --jitter or --budget"
        )
    if options["continue_from"] is not None and not options["allow_after_outage"]:
        raise click.UsageError("--continue-from needs a time; give --allow-after-outage SECONDS")
    source = click.get_current_context().get_parameter_source("allow_direct")
    if source is not ParameterSource.DEFAULT and mode != "direct":
        raise click.UsageError(
            f"--allow-direct has no effect on --mode {mode}; omit it, or give --mode direct"
        )


def _round_up(seconds: float) -> str:
    return f"{ceil(TENTHS * seconds) / TENTHS:g}"
