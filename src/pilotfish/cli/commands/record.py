"""pilotfish record: demonstrations of a task, shown in physics by a simulated person."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_table,
    print_result,
    require_finite_option,
    require_writable_folder,
)
from pilotfish.cli.output.terminal import is_interactive, print_note
from pilotfish.errors import InvalidInput
from pilotfish.io import write_demonstrations
from pilotfish.simulation import require_mujoco

if TYPE_CHECKING:
    from pilotfish.environments import Task
    from pilotfish.simulation import RecordedDemonstration


@click.command(
    epilog=example_epilog(
        "pilotfish tasks", "pilotfish record carabiner --demonstrations 4 --seed 0 --out hooking"
    )
)
@click.argument("task")
@click.option(
    "--demonstrations",
    type=click.IntRange(1, 10_000),
    default=8,
    show_default=True,
    help="Number of demonstrations.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the random number generator.",
)
@click.option(
    "--delay",
    type=click.FloatRange(min=0.0, max=10.0),
    callback=require_finite_option,
    default=0.0,
    show_default=True,
    help="How late the person sees what the tool does [s].",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="The folder to write.  [default: named after the task]"
)
@click.option("--force", is_flag=True, help="Replace a folder of demonstrations that is there already.")
@print_result
def record(task: str, demonstrations: int, seed: int, delay: float, **files: Any) -> CommandResult:
    """Record showings of TASK, each in a situation of its own, as a folder that learn reads.

    A simulated person leads one arm of the robot, the other follows and does the work in physics. The same
    seed gives the same recordings, bit for bit. A showing that does not do the work is shown again.
    """
    require_mujoco()
    from pilotfish.simulation import record_demonstrations  # needs MuJoCo

    chosen_task = find_task(task)
    folder, force = files["out"] or Path(task), files["force"]
    require_writable_folder(folder, force=force)
    recordings = []
    for recording, attempts in record_demonstrations(chosen_task, demonstrations, seed, delay=delay):
        recordings.append((recording, attempts))
        if is_interactive():
            print_note(f"shown {len(recordings)} of {demonstrations}, {recording.duration:.1f} s")
    write_demonstrations(
        [recording.demonstration for recording, _ in recordings], folder, overwrite=force, use_free_name=True
    )
    facts = {
        "folder": str(folder),
        "task": task,
        "seed": seed,
        "delay": delay,
        "demonstrations": [_recording_to_json(recording, attempts) for recording, attempts in recordings],
    }
    return CommandResult(f"{_format_recordings(recordings, chosen_task.unit)}\n\nwritten to {folder}", facts)


@click.command(epilog=example_epilog("pilotfish tasks"))
@print_result
def tasks() -> CommandResult:
    """List the tasks that can be recorded and performed in physics."""
    require_mujoco()
    from pilotfish.environments import TASKS  # needs MuJoCo

    rows = [(name, task.description, ", ".join(task.frames)) for name, task in sorted(TASKS.items())]
    facts = {
        name: {
            "about": task.description,
            "frames": list(task.frames),
            "unit": task.unit,
            "seconds": task.time_limit,
        }
        for name, task in sorted(TASKS.items())
    }
    return CommandResult(format_table(("task", "what", "frames"), rows), {"tasks": facts})


def find_task(name: str) -> "Task[Any]":
    """The task of that name.    Raises: InvalidInput, when there is none."""
    from pilotfish.environments import TASKS  # needs MuJoCo

    if name not in TASKS:
        raise InvalidInput(f"there is no task {name!r}, expected one of {', '.join(sorted(TASKS))}")
    return TASKS[name]


def _format_recordings(recordings: "list[tuple[RecordedDemonstration, int]]", unit: str) -> str:
    rows = [
        (
            recording.demonstration.name,
            f"{recording.duration:.1f}",
            str(len(recording.demonstration.x)),
            f"{recording.outcome.error:.2g}",
            f"{recording.peak_forces['tool']:.0f}",
            str(attempts),
        )
        for recording, attempts in recordings
    ]
    return format_table(
        ("name", "seconds", "steps", f"error [{unit}]", "largest force [N]", "attempts"), rows
    )


def _recording_to_json(recording: "RecordedDemonstration", attempts: int) -> dict[str, object]:
    return {
        "name": recording.demonstration.name,
        "seconds": recording.duration,
        "steps": len(recording.demonstration.x),
        "error": recording.outcome.error,
        "peak_forces": recording.peak_forces,
        "attempts": attempts,
    }
