"""pilotfish drive: operate the simulated robot over a link, with or without assistance."""

from collections.abc import Callable
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.options.demonstrations import load_demonstrations
from pilotfish.cli.options.execution import (
    FILE,
    TASK_OPTION,
    execution_options,
    require_one_situation,
    require_simulation,
)
from pilotfish.cli.output.attempts import Attempt, format_attempt, name_situation, summarise_attempts
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
)
from pilotfish.cli.output.tables import key_value_table
from pilotfish.cli.output.terminal import is_interactive, live_line, print_note
from pilotfish.io import open_skill
from pilotfish.models import Skill

if TYPE_CHECKING:
    from pilotfish.assistance import Assistant, Command, Target, VirtualFixture
    from pilotfish.environments import Task, Workcell
    from pilotfish.simulation import FilmRecorder, TeleoperationResult

MODES = ("direct", "shared", "autonomous", "fixture")
ELLIPSOIDS = (1.0, 2.0)  # standard deviations
LIVE_PERIOD = 0.1  # s of simulated time
FILM_DISTANCE = 1.15  # relative to the view of the task: both arms are in the image
CM, MM = 100.0, 1000.0


def _number_option(
    name: str, maximum: float, text: str, *, default: float = 0.0
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return an option with a number from 0 to a maximum."""
    return click.option(
        name,
        type=click.FloatRange(0.0, maximum),
        callback=require_finite_option,
        default=default,
        show_default=True,
        help=text,
    )


@click.command(
    epilog=example_epilog(
        "pilotfish drive hooking.skill --task carabiner --delay 1 --view-off 3 --situations 2 "
        "--film driving.webp",
        "pilotfish drive hooking.skill --task carabiner --mode direct --view-off 3 --situations 2",
        "pilotfish drive hooking.skill --task carabiner --mode fixture --demonstrations hooking "
        "--situations 1",
    )
)
@click.argument("skill", type=FILE)
@TASK_OPTION
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default="shared",
    show_default=True,
    help="Direct control, shared control (corrects the operator), autonomous control (takes over) or a "
    "virtual fixture (guides the robot along the path).",
)
@click.option(
    "--demonstrations",
    metavar="FOLDER",
    help="With --mode fixture, demonstrations of the task from which the path is learned, or dataset:NAME.",
)
@_number_option("--delay", 60.0, "Delay of the link in each direction [s].")
@_number_option(
    "--view-off", 100.0, "Distance by which the objects are displaced in what the operator sees [cm]."
)
@_number_option("--view-turn", 180.0, "Angle by which they are turned about the vertical [degrees].")
@_number_option(
    "--switch-after",
    3600.0,
    "With --mode autonomous, time of shared control before it takes over [s].",
    default=2.0,
)
@execution_options
@print_result
def drive(
    skill: Path,
    task: str,
    situations: int,
    seed: int,
    situation: int | None,
    film: Path | None,
    **options: Any,
) -> CommandResult:
    """Operate the simulated robot with a simulated person, assisted by the skill in the file SKILL.

    The person guides the left arm in a local scene, which may be late and displaced. The right arm is at the
    other end of the link, where the skill corrects what arrives. A failure is explained by the first phase of
    the task that was not passed. The exit code is 0 also if some situations fail.
    """
    require_one_situation(situation, "situations")
    _require_options_of_mode(options["mode"])
    require_simulation(skill, film, meshes=options["meshes"], force=options["force"])
    from pilotfish.assistance import assisted_skill, make_assistant

    selected, learned = find_task(task), open_skill(skill)
    fixture = _learn_fixture(options["demonstrations"]) if options["mode"] == "fixture" else None
    assistant = make_assistant([assisted_skill(learned, fixture=fixture)])
    _require_order_in_time(learned, options["mode"])
    numbers = range(situations) if situation is None else (situation,)
    attempts: list[Attempt] = []
    driven: list[TeleoperationResult] = []
    for number in numbers:
        result = _drive_once(assistant, selected, (seed, number), None if driven else film, options)
        driven.append(result)
        attempts.append(Attempt(seed, number, result))
        if is_interactive():
            print_note(f"{name_situation(attempts[-1], 1)}: {format_attempt(attempts[-1], selected.unit)}")
    return _add_assistance(summarise_attempts(attempts, selected, film), driven, options)


def _require_options_of_mode(mode: str) -> None:
    """Raise click.UsageError if an option has no effect on the mode, or if its recordings are missing."""
    context = click.get_current_context()
    for name, owner in (("switch_after", "autonomous"), ("demonstrations", "fixture")):
        option = "--" + name.replace("_", "-")
        if mode != owner and context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{option} has no effect on --mode {mode}; give --mode {owner}")
    if mode == "fixture" and not context.params["demonstrations"]:
        raise click.UsageError(
            "--mode fixture needs the recordings of the task; give --demonstrations FOLDER, from which SKILL "
            "was learned"
        )


def _learn_fixture(source: str) -> "VirtualFixture":
    """Return the virtual fixture of the demonstrations in a folder."""
    import numpy as np

    from pilotfish.assistance import learn_virtual_fixture

    return learn_virtual_fixture(load_demonstrations(source), rng=np.random.default_rng(0))


def _require_order_in_time(skill: Skill, mode: str) -> None:
    if mode == "autonomous" and not skill.dynamics.has_time_order:
        raise click.UsageError(
            "--mode autonomous needs a skill with an order in time, and this one has none; learn it without "
            "--dynamics mixture, or choose --mode shared"
        )


def _drive_once(
    assistant: "Assistant",
    task: "Task[Any]",
    seed: tuple[int, int],
    film: Path | None,
    options: dict[str, Any],
) -> "TeleoperationResult":
    """Operate in the situation of a seed and a number, and write a film if a file is given."""
    import numpy as np

    from pilotfish.simulation import FilmRecorder, Link, baxter_meshes, situation_from_seed, teleoperate

    camera = FilmRecorder(distance=FILM_DISTANCE) if film else None
    with live_line() as print_line:
        result = teleoperate(
            assistant,
            task,
            situation_from_seed(task, "test", *seed),
            np.random.default_rng([*seed, 1]),
            mode=_mode_at(options["mode"], options["switch_after"]),
            link=Link(options["delay"], options["view_off"] / CM, radians(options["view_turn"])),
            on_step=_observer(camera, print_line),
            visual_meshes=baxter_meshes() if options["meshes"] and film else (),
        )
    if camera and film:
        _write_film(camera, film, task, seed, result, options)
    return result


def _mode_at(mode: str, switch_after: float) -> str | Callable[[float], str]:
    """Return the mode, or a function that switches from shared to autonomous control."""
    if mode != "autonomous":
        return mode
    return lambda time: "shared" if time < switch_after else "autonomous"


def _observer(
    camera: "FilmRecorder | None", print_line: Callable[[str], None]
) -> Callable[["Workcell[Any]", "Command", "Target"], None]:
    """Return a function that films a step and prints its numbers."""
    next_line = 0.0

    def observe(cell: "Workcell[Any]", command: "Command", target: "Target") -> None:
        nonlocal next_line
        if camera:
            _film_step(camera, cell, command, target)
        if cell.time >= next_line:
            next_line = cell.time + LIVE_PERIOD
            off = MM * float(sum((command.hand[:3] - target.pose[:3]) ** 2)) ** 0.5
            print_line(
                f"{cell.time:5.1f} s  {target.mode:10}  state {int(target.probabilities.argmax()):2}  "
                f"authority {target.authority:4.2f}  corrected by {off:4.0f} mm  "
                f"force {cell.forces['tool']:3.0f} N"
            )

    return observe


def _film_step(camera: "FilmRecorder", cell: "Workcell[Any]", command: "Command", target: "Target") -> None:
    """Film the arms, a copy of the tool at the command, and the covariance of the target."""
    from pilotfish.environments import Ellipsoid, ToolCopy
    from pilotfish.geometry import Pose

    covariance = target.covariance[:3, :3]
    hand = Pose(command.hand[:3], command.hand[3:7])
    camera(
        cell,
        ellipsoids=[Ellipsoid(target.pose[:3], covariance, deviations) for deviations in ELLIPSOIDS],
        tool_copies=[ToolCopy(cell.mounted_tool.point, hand)],
    )


def _write_film(
    camera: "FilmRecorder",
    film: Path,
    task: "Task[Any]",
    seed: tuple[int, int],
    result: "TeleoperationResult",
    options: dict[str, Any],
) -> None:
    from pilotfish.simulation import caption_images, write_film

    images = caption_images(
        camera.images,
        camera.times,
        camera.phases,
        title=f"{task.name}, {options['mode']}, situation {seed[1]}, seed {seed[0]}",
        outcome=f"failed: {result.failure.summary}" if result.failure else "succeeded",
        success=result.outcome.success,
    )
    write_film(images, film, camera.period, overwrite=options["force"])
    camera.close()


def _add_assistance(
    summary: CommandResult, driven: list["TeleoperationResult"], options: dict[str, Any]
) -> CommandResult:
    """Return the summary with the mode, the authority and the correction."""
    import numpy as np

    authority = float(np.mean([result.authority.mean() for result in driven]))
    corrections = [np.linalg.norm(r.hands[:, :3] - r.targets[:, :3], axis=1).mean() for r in driven]
    rows = [
        ("mode", options["mode"]),
        ("authority, mean", f"{authority:.2f}"),
        ("correction, mean", f"{MM * float(np.mean(corrections)):.0f} mm"),
    ]
    data = {
        **summary.data,
        "mode": options["mode"],
        "authority": authority,
        "correction": float(np.mean(corrections)),
    }
    return replace(summary, blocks=[key_value_table(rows), *summary.blocks], data=data)
