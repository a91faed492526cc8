"""pilotfish perform: execute a skill with the simulated robot, in situations without demonstrations."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.options.planning import planning_options
from pilotfish.cli.output.attempts import Attempt, format_attempt, name_situation, summarise_attempts
from pilotfish.cli.output.motion_notes import option_name
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
)
from pilotfish.cli.output.terminal import is_interactive, print_note
from pilotfish.io import open_skill
from pilotfish.models import Skill
from pilotfish.planning import motion_notes
from pilotfish.rendering import require_mujoco, require_renderer

if TYPE_CHECKING:
    from pilotfish.environments import Task
    from pilotfish.simulation import ExecutionResult

FILE = click.Path(path_type=Path)
FILM_SUFFIXES = (".webp", ".gif")


def validate_film_path(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """Return a path with the suffix of a film, or raise click.BadParameter."""
    if path and path.suffix.lower() not in FILM_SUFFIXES:
        expected = " or ".join(FILM_SUFFIXES)
        raise click.BadParameter(f"{path} ends in {path.suffix!r}, expected {expected}", param=parameter)
    return path


@click.command(
    epilog=example_epilog(
        "pilotfish perform hooking.skill --task carabiner --situations 2 --film hooking.webp"
    )
)
@click.argument("skill", type=FILE)
@click.option("--task", required=True, help="Task that the skill was learned for; see `pilotfish tasks`.")
@click.option(
    "--situations",
    type=click.IntRange(1, 10_000),
    default=20,
    show_default=True,
    help="Number of random situations.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the situations."
)
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    default=1,
    show_default=True,
    help="Number of seeds, from --seed on; each gives other situations, and the spread is printed.",
)
@click.option(
    "--situation",
    type=click.IntRange(0, 9_999),
    help="Execute only the situation with this number, as printed with its failure.",
)
@planning_options
@click.option(
    "--film",
    type=FILE,
    callback=validate_film_path,
    help="Film to write, as .webp or .gif, of the first situation or of that of --situation.",
)
@click.option("--meshes", is_flag=True, help="Show the visual meshes of pilotfish[meshes] in the film.")
@click.option("--force", is_flag=True, help="Replace an existing film.")
@print_result
def perform(
    skill: Path,
    task: str,
    situations: int,
    seed: int,
    seeds: int,
    situation: int | None,
    film: Path | None,
    **options: Any,
) -> CommandResult:
    """Execute the skill in the file SKILL in simulated physics, in situations without demonstrations.

    The skill is adapted to the frames of the objects, and an impedance controller at 1 kHz tracks the planned
    motion. A failure is explained by the first phase of the task that was not passed. The exit code is 0 also
    if some situations fail.
    """
    if options["meshes"] and not film:
        raise click.UsageError("--meshes needs a film to show them in; give --film FILE")
    require_one_situation(situation, "situations", "seeds")
    require_mujoco()
    from pilotfish.simulation import require_pillow

    require_writable_file(film, force=options["force"], inputs=(skill,))
    if film:
        require_pillow()
        require_renderer()
    selected, learned = find_task(task), open_skill(skill)
    numbers = range(situations) if situation is None else (situation,)
    notes = _compare_motion(learned, selected, (seed, numbers[0]), options)
    for note in notes:
        print_note(f"note, situation {numbers[0]}: {note}")
    attempts: list[Attempt] = []
    for key in product(range(seed, seed + seeds), numbers):
        execution = _execute(learned, selected, key, None if attempts else film, options)
        attempts.append(Attempt(*key, execution))
        if is_interactive():
            print_note(
                f"{name_situation(attempts[-1], seeds)}: {format_attempt(attempts[-1], selected.unit)}"
            )
    result = summarise_attempts(attempts, selected, film)
    return replace(result, data={**result.data, "notes": list(notes)})


def require_one_situation(situation: int | None, *numbers: str) -> None:
    """Raise click.UsageError if one situation and options that give a number of them are both given."""
    if situation is None:
        return
    context = click.get_current_context()
    for name in numbers:
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"--situation executes one situation; omit --{name}")


def _compare_motion(
    skill: Skill, task: "Task[Any]", seed: tuple[int, int], options: dict[str, Any]
) -> tuple[str, ...]:
    """Return notes on the motion that is planned at the start of a situation."""
    from pilotfish.simulation import plan_in_situation, situation_from_seed

    planning = {key: options[key] for key in ("horizon", "control_cost", "covariance_regularisation")}
    situation = situation_from_seed(task, "test", *seed)
    reproduction, frames = plan_in_situation(skill, task, situation, **planning)
    return motion_notes(skill, reproduction, frames, name_argument=option_name)


def _execute(
    skill: Skill,
    task: "Task[Any]",
    seed: tuple[int, int],
    film: Path | None,
    options: dict[str, Any],
) -> "ExecutionResult":
    """Execute the skill in the situation of a seed and a number, and write a film if a file is given."""
    from pilotfish.simulation import (
        FilmRecorder,
        baxter_meshes,
        caption_images,
        situation_from_seed,
        write_film,
    )
    from pilotfish.simulation import perform as simulate

    camera = FilmRecorder() if film else None
    execution = simulate(
        skill,
        task,
        situation_from_seed(task, "test", *seed),
        horizon=options["horizon"],
        control_cost=options["control_cost"],
        covariance_regularisation=options["covariance_regularisation"],
        on_period=camera,
        visual_meshes=baxter_meshes() if options["meshes"] and film else (),
    )
    if camera and film:
        images = caption_images(
            camera.images,
            camera.times,
            camera.phases,
            title=f"{task.name}, situation {seed[1]}, seed {seed[0]}",
            outcome=f"failed: {failure.summary}" if (failure := execution.failure) else "succeeded",
            success=execution.outcome.success,
        )
        write_film(images, film, camera.period, overwrite=options["force"])
        camera.close()
    return execution
