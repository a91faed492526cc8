"""pilotfish record and pilotfish tasks: simulated demonstrations of a task."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.options.execution import load_robot, robot_options
from pilotfish.cli.options.learning import seed_option
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_folder,
)
from pilotfish.cli.output.tables import Table
from pilotfish.cli.output.terminal import is_interactive, print_note
from pilotfish.errors import InvalidInput
from pilotfish.io import write_demonstrations
from pilotfish.rendering import require_mujoco

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
@seed_option
@click.option(
    "--delay",
    type=click.FloatRange(min=0.0, max=10.0),
    callback=require_finite_option,
    default=0.0,
    show_default=True,
    help="Delay after which the simulated person observes the tool [s].",
)
@robot_options
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder to write.  [default: the name of the task]"
)
@click.option("--force", is_flag=True, help="Replace an existing folder of demonstrations.")
@print_result
def record(
    task: str,
    demonstrations: int,
    seed: int,
    delay: float,
    robot: str,
    end_effector: str | None,
    out: Path | None,
    force: bool,
) -> CommandResult:
    """Record simulated demonstrations of TASK, each in a random situation, in the format that `learn` reads.

    A simulated person moves the leader arm of the robot; the follower arm performs the task in physics. For
    a robot with one arm, the person's hand itself is the leader. A demonstration that fails is repeated. The
    same seed gives the same demonstrations, bit for bit.
    """
    require_mujoco()
    from pilotfish.simulation import record_demonstrations

    selected, arm = find_task(task), load_robot(robot, end_effector)
    folder = out or Path(task)
    require_writable_folder(folder, force=force)
    recordings = []
    for recording, attempts in record_demonstrations(selected, demonstrations, seed, delay=delay, robot=arm):
        recordings.append((recording, attempts))
        if is_interactive():
            print_note(f"demonstration {len(recordings)} of {demonstrations}: {recording.duration:.1f} s")
    recorded = [recording.demonstration for recording, _ in recordings]
    write_demonstrations(recorded, folder, overwrite=force, use_free_name=True)
    data = {
        "folder": str(folder),
        "task": task,
        "robot": arm.name,
        "seed": seed,
        "delay": delay,
        "demonstrations": [_recording_to_json(recording, attempts) for recording, attempts in recordings],
    }
    return CommandResult([_recording_table(recordings, selected.unit), f"written to {folder}"], data)


@click.command(epilog=example_epilog("pilotfish tasks"))
@print_result
def tasks() -> CommandResult:
    """List the simulated tasks of `record`, `perform` and `drive`."""
    require_mujoco()
    from pilotfish.environments import TASKS

    rows = [(name, task.description, ", ".join(task.frames)) for name, task in sorted(TASKS.items())]
    data = {
        name: {
            "description": task.description,
            "frames": list(task.frames),
            "unit": task.unit,
            "time_limit": task.time_limit,
        }
        for name, task in sorted(TASKS.items())
    }
    return CommandResult([Table(("task", "description", "frames"), tuple(rows))], {"tasks": data})


def find_task(name: str) -> "Task[Any]":
    """Return a task by its name, or raise InvalidInput with the names that exist."""
    from pilotfish.environments import TASKS

    if name not in TASKS:
        raise InvalidInput(f"task {name!r} is unknown, expected one of {', '.join(sorted(TASKS))}")
    return TASKS[name]


def _recording_table(recordings: "list[tuple[RecordedDemonstration, int]]", unit: str) -> Table:
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
    header = ("name", "duration [s]", "steps", f"error [{unit}]", "peak force [N]", "attempts")
    return Table(header, tuple(rows))


def _recording_to_json(recording: "RecordedDemonstration", attempts: int) -> dict[str, object]:
    return {
        "name": recording.demonstration.name,
        "seconds": recording.duration,
        "steps": len(recording.demonstration.x),
        "error": recording.outcome.error,
        "peak_forces": recording.peak_forces,
        "attempts": attempts,
    }
