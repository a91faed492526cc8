"""pilotfish perform: a skill carried out by the robot in physics, in situations that were never shown."""

from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_table,
    print_result,
    require_finite_option,
    require_writable_file,
)
from pilotfish.cli.output.terminal import is_interactive, print_note
from pilotfish.io import open_skill
from pilotfish.models import MAX_HORIZON
from pilotfish.planning import CONTROL_COST, COVARIANCE_REGULARISATION
from pilotfish.simulation import require_mujoco, require_renderer

if TYPE_CHECKING:
    from pilotfish.simulation import ExecutionResult

FILE = click.Path(path_type=Path)
FILM_SUFFIXES = (".webp", ".gif")


def validate_film_path(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """A path that ends in a kind of film.    Raises: click.BadParameter."""
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
@click.option("--task", required=True, help="The task that the skill is for; pilotfish tasks lists them.")
@click.option(
    "--situations",
    type=click.IntRange(1, 10_000),
    default=20,
    show_default=True,
    help="How many unseen situations.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the situations."
)
@click.option(
    "--horizon",
    type=click.IntRange(2, MAX_HORIZON),
    help="How many steps.  [default: as many as the demonstrations had on average]",
)
@click.option(
    "--control-cost",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    default=CONTROL_COST,
    show_default=True,
    help="R, the cost of squared acceleration; a larger value gives a softer motion.",
)
@click.option(
    "--covariance-regularisation",
    type=click.FloatRange(min=0.0),
    callback=require_finite_option,
    default=COVARIANCE_REGULARISATION,
    show_default=True,
    help="Variance added to every variance before it becomes a weight [unit squared].",
)
@click.option(
    "--film", type=FILE, callback=validate_film_path, help="The first situation as a .webp or .gif film."
)
@click.option("--meshes", is_flag=True, help="The robot wears the meshes of pilotfish[meshes] in the film.")
@click.option("--force", is_flag=True, help="Replace a film that is there already.")
@print_result
def perform(
    skill: Path, task: str, situations: int, seed: int, film: Path | None, **options: Any
) -> CommandResult:
    """Carry out the skill in the file SKILL in physics, in situations never shown, and tell how it went.

    The skill is adapted to where the objects stand, planned and tracked; springs and dampers at 1 kHz carry
    it out. Exit code 0, however many situations succeed.
    """
    if options["meshes"] and not film:
        raise click.UsageError("--meshes is how the robot looks in a film; name one: --film FILE")
    require_mujoco()
    from pilotfish.simulation import (  # needs MuJoCo
        FilmRecorder,
        baxter_meshes,
        require_pillow,
        situation_from_seed,
        write_film,
    )
    from pilotfish.simulation import perform as simulate

    require_writable_file(film, force=options["force"], inputs=(skill,))
    if film:
        require_pillow()
        require_renderer()
    chosen_task, learned = find_task(task), open_skill(skill)
    visual_meshes = baxter_meshes() if options["meshes"] else ()
    executions = []
    for n in range(situations):
        camera = FilmRecorder() if film and n == 0 else None
        situation = situation_from_seed(chosen_task, "test", seed, n)
        execution = simulate(
            learned,
            chosen_task,
            situation,
            horizon=options["horizon"],
            control_cost=options["control_cost"],
            covariance_regularisation=options["covariance_regularisation"],
            on_period=camera,
            visual_meshes=visual_meshes,
        )
        if camera and film:
            write_film(camera.images, film, camera.period, overwrite=options["force"])
            camera.close()
        executions.append(execution)
        if is_interactive():
            print_note(f"situation {n}: {_describe_execution(execution, chosen_task.unit)}")
    return _to_result(executions, chosen_task.unit, film)


def _describe_execution(execution: "ExecutionResult", unit: str) -> str:
    how = "done" if execution.outcome.success else f"not done, {execution.outcome.reason}"
    numbers = f"error {execution.outcome.error:.2g} {unit}, at most {execution.peak_forces['tool']:.0f} N, {execution.duration:.1f} s"
    return f"{how}; {numbers}"


def _to_result(executions: "list[ExecutionResult]", unit: str, film: Path | None) -> CommandResult:
    succeeded = sum(execution.outcome.success for execution in executions)
    rows = [
        ("succeeded", f"{succeeded} of {len(executions)}"),
        ("error, median", f"{median(execution.outcome.error for execution in executions):.2g} {unit}"),
        ("error, largest", f"{max(execution.outcome.error for execution in executions):.2g} {unit}"),
        (
            "largest force, median",
            f"{median(execution.peak_forces['tool'] for execution in executions):.1f} N",
        ),
        ("time, median", f"{median(execution.duration for execution in executions):.1f} s"),
    ]
    failures = [
        f"situation {n}: {execution.outcome.reason}"
        for n, execution in enumerate(executions)
        if not execution.outcome.success
    ]
    facts = {
        "succeeded": succeeded,
        "situations": [_execution_to_json(execution) for execution in executions],
        "film": str(film) if film else None,
        "unit": unit,
    }
    return CommandResult("\n".join([format_table(("what", ""), rows), *failures]), facts)


def _execution_to_json(execution: "ExecutionResult") -> dict[str, object]:
    outcome = execution.outcome
    return {
        "success": outcome.success,
        "error": outcome.error,
        "reason": outcome.reason,
        "peak_forces": execution.peak_forces,
        "seconds": execution.duration,
    }
