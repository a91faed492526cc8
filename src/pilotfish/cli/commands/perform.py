"""pilotfish perform: execute a skill with the simulated robot, in situations without demonstrations."""

from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.options.planning import planning_options
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
)
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.cli.output.terminal import is_interactive, print_note
from pilotfish.io import open_skill
from pilotfish.models import Skill
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
@planning_options
@click.option(
    "--film",
    type=FILE,
    callback=validate_film_path,
    help="Film of the first situation to write, as .webp or .gif.",
)
@click.option("--meshes", is_flag=True, help="Show the visual meshes of pilotfish[meshes] in the film.")
@click.option("--force", is_flag=True, help="Replace an existing film.")
@print_result
def perform(
    skill: Path, task: str, situations: int, seed: int, film: Path | None, **options: Any
) -> CommandResult:
    """Execute the skill in the file SKILL in simulated physics, in situations without demonstrations.

    The skill is adapted to the frames of the objects, and an impedance controller at 1 kHz tracks the planned
    motion. The exit code is 0 also if some situations fail.
    """
    if options["meshes"] and not film:
        raise click.UsageError("--meshes needs a film to show them in; give --film FILE")
    require_mujoco()
    from pilotfish.simulation import require_pillow

    require_writable_file(film, force=options["force"], inputs=(skill,))
    if film:
        require_pillow()
        require_renderer()
    selected, learned = find_task(task), open_skill(skill)
    executions = []
    for n in range(situations):
        execution = _execute(learned, selected, (seed, n), film if n == 0 else None, options)
        executions.append(execution)
        if is_interactive():
            print_note(f"situation {n}: {_format_execution(execution, selected.unit)}")
    return _to_result(executions, selected.unit, film)


def _execute(
    skill: Skill,
    task: "Task[Any]",
    seed: tuple[int, int],
    film: Path | None,
    options: dict[str, Any],
) -> "ExecutionResult":
    """Execute the skill in the situation of a seed and a number, and write a film if a file is given."""
    from pilotfish.simulation import FilmRecorder, baxter_meshes, situation_from_seed, write_film
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
        write_film(camera.images, film, camera.period, overwrite=options["force"])
        camera.close()
    return execution


def _format_execution(execution: "ExecutionResult", unit: str) -> str:
    outcome = execution.outcome
    result = "success" if outcome.success else f"failure, {outcome.reason}"
    force = execution.peak_forces["tool"]
    return f"{result}; error {outcome.error:.2g} {unit}, peak force {force:.0f} N, {execution.duration:.1f} s"


def _to_result(executions: "list[ExecutionResult]", unit: str, film: Path | None) -> CommandResult:
    errors = [execution.outcome.error for execution in executions]
    succeeded = sum(execution.outcome.success for execution in executions)
    rows = [
        ("succeeded", f"{succeeded} of {len(executions)}"),
        ("error, median", f"{median(errors):.2g} {unit}"),
        ("error, maximum", f"{max(errors):.2g} {unit}"),
        ("peak force, median", f"{median(e.peak_forces['tool'] for e in executions):.1f} N"),
        ("duration, median", f"{median(e.duration for e in executions):.1f} s"),
    ]
    failures = [
        f"situation {n}: {execution.outcome.reason}"
        for n, execution in enumerate(executions)
        if not execution.outcome.success
    ]
    blocks: list[str | Table] = [key_value_table(rows), *(["\n".join(failures)] if failures else [])]
    data = {
        "succeeded": succeeded,
        "situations": [_execution_to_json(execution) for execution in executions],
        "film": str(film) if film else None,
        "unit": unit,
    }
    return CommandResult(blocks, data)


def _execution_to_json(execution: "ExecutionResult") -> dict[str, object]:
    outcome = execution.outcome
    return {
        "success": outcome.success,
        "error": outcome.error,
        "reason": outcome.reason,
        "peak_forces": execution.peak_forces,
        "seconds": execution.duration,
    }
