"""pilotfish record: demonstrations of a task, shown in physics by a simulated person."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.demonstrations import write_folder
from pilotfish.errors import InvalidInput
from pilotfish.station.answers import Answer, answering, example, remark, table
from pilotfish.station.rendering import require_mujoco

if TYPE_CHECKING:
    from pilotfish.environments import Task
    from pilotfish.station.recorder import Recording


@click.command(
    epilog=example("pilotfish tasks", "pilotfish record valve --demonstrations 8 --seed 0 --out valve")
)
@click.argument("task")
@click.option(
    "--demonstrations", type=click.IntRange(min=1), default=8, show_default=True, help="How many showings."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of all chance.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="The folder to write.  [default: named after the task]"
)
@click.option("--force", is_flag=True, help="Replace a folder of demonstrations that is there already.")
@answering
def record(task: str, demonstrations: int, seed: int, out: Path | None, force: bool) -> Answer:
    """Record showings of TASK, each in a situation of its own, as a folder that learn reads.

    A simulated person leads one arm of the robot, the other follows and does the work in physics. The same
    seed gives the same recordings, bit for bit. A showing that does not do the work is shown again.
    """
    require_mujoco()
    from pilotfish.station.recorder import shown  # needs MuJoCo

    wanted = task_named(task)
    folder = out or Path(task)
    if folder.exists() and not force and (not folder.is_dir() or any(folder.iterdir())):
        raise InvalidInput(f"{folder} exists; choose another name, or replace it with --force")
    made = []
    for recording, tries in shown(wanted, demonstrations, seed):
        made.append((recording, tries))
        remark(_line(recording, tries, wanted.unit))
    write_folder([recording.demonstration for recording, _ in made], folder, overwrite=force)
    facts = {
        "folder": str(folder),
        "task": task,
        "seed": seed,
        "demonstrations": [_facts(recording, tries) for recording, tries in made],
    }
    return Answer(f"written to {folder}; pilotfish learn {folder} --out {task}.skill learns from it", facts)


@click.command(epilog=example("pilotfish tasks"))
@answering
def tasks() -> Answer:
    """List the tasks that can be recorded and performed in physics."""
    require_mujoco()
    from pilotfish.environments import TASKS  # needs MuJoCo

    rows = [(name, task.about, ", ".join(task.frames)) for name, task in sorted(TASKS.items())]
    facts = {
        name: {"about": task.about, "frames": list(task.frames), "unit": task.unit, "seconds": task.seconds}
        for name, task in sorted(TASKS.items())
    }
    return Answer(table(("task", "what", "frames"), rows), {"tasks": facts})


def task_named(name: str) -> "Task[Any]":
    """The task of that name.    Raises: InvalidInput, when there is none."""
    from pilotfish.environments import TASKS  # needs MuJoCo

    if name not in TASKS:
        raise InvalidInput(f"there is no task {name!r}, expected one of {', '.join(sorted(TASKS))}")
    return TASKS[name]


def _line(recording: "Recording", tries: int, unit: str) -> str:
    shown, again = recording.demonstration, f", shown {tries} times" if tries > 1 else ""
    return (
        f"{shown.name}: {recording.seconds:.1f} s, {len(shown.x)} rows, error {recording.verdict.error:.2g} "
        f"{unit}, largest force {recording.peaks['tool']:.0f} N{again}"
    )


def _facts(recording: "Recording", tries: int) -> dict[str, object]:
    return {
        "name": recording.demonstration.name,
        "seconds": recording.seconds,
        "rows": len(recording.demonstration.x),
        "error": recording.verdict.error,
        "peaks": recording.peaks,
        "tries": tries,
    }
