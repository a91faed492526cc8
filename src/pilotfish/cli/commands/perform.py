"""pilotfish perform: execute a skill with the simulated robot, in situations without demonstrations."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.options.execution import (
    FILE,
    TASK_OPTION,
    execution_options,
    load_robot,
    require_one_situation,
    require_simulation,
    robot_options,
)
from pilotfish.cli.options.planning import planning_options
from pilotfish.cli.output.attempts import Attempt, format_attempt, name_situation, summarise_attempts
from pilotfish.cli.output.motion_notes import option_name
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
)
from pilotfish.cli.output.terminal import is_interactive, print_note
from pilotfish.io import open_skill
from pilotfish.models import Skill
from pilotfish.planning import motion_notes
from pilotfish.rendering import require_renderer

if TYPE_CHECKING:
    from pilotfish.environments import Task
    from pilotfish.simulation import ExecutionResult


@click.command(
    epilog=example_epilog(
        "pilotfish perform hooking.skill --task carabiner --situations 2 --film hooking.webp"
    )
)
@click.argument("skill", type=FILE)
@TASK_OPTION
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    default=1,
    show_default=True,
    help="Number of seeds, from --seed on; each gives other situations, and the spread is printed.",
)
@click.option(
    "--camera",
    is_flag=True,
    help="Estimate the frames from the images of a simulated camera, by markers on the objects.",
)
@robot_options
@planning_options
@execution_options
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
    motion. The robot need not be the one that the skill was recorded with. A failure is explained by the
    first phase of the task that was not passed. The exit code is 0 also if some situations fail.
    """
    require_one_situation(situation, "situations", "seeds")
    require_simulation(skill, film, meshes=options["meshes"], force=options["force"])
    if options["camera"]:
        require_renderer()
    selected, learned = find_task(task), open_skill(skill)
    options["robot"] = load_robot(options["robot"], options["end_effector"], meshes=options["meshes"])
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
    return replace(result, data={**result.data, "robot": options["robot"].name, "notes": list(notes)})


def _compare_motion(
    skill: Skill, task: "Task[Any]", seed: tuple[int, int], options: dict[str, Any]
) -> tuple[str, ...]:
    """Return notes on the motion that is planned at the start of a situation."""
    from pilotfish.simulation import plan_in_situation, situation_from_seed

    names = ("horizon", "control_cost", "covariance_regularisation", "robot")
    planning = {key: options[key] for key in names}
    situation = situation_from_seed(task, "test", *seed)
    reproduction, frames = plan_in_situation(skill, task, situation, **planning)
    return motion_notes(skill, reproduction, frames, name_argument=option_name)


def _simulate_from_camera(
    skill: Skill, task: "Task[Any]", situation: Any, **options: Any
) -> "ExecutionResult":
    """Execute the skill from the frames that a simulated camera sees."""
    from pilotfish.simulation import perform_from_camera

    return perform_from_camera(skill, task, situation, **options).execution


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
    execution = (_simulate_from_camera if options["camera"] else simulate)(
        skill,
        task,
        situation_from_seed(task, "test", *seed),
        horizon=options["horizon"],
        control_cost=options["control_cost"],
        covariance_regularisation=options["covariance_regularisation"],
        on_period=camera,
        robot=options["robot"],
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
