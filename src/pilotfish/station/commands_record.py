"""pilotfish record: demonstrations of a task, shown in physics by a simulated person."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.demonstrations import write_folder
from pilotfish.errors import InvalidInput
from pilotfish.station.answers import Answer, answering, example, finite, require_new_folder, table
from pilotfish.station.output import a_person_watches, remark
from pilotfish.station.rendering import require_mujoco

if TYPE_CHECKING:
    from pilotfish.environments import Task
    from pilotfish.station.recorder import Recording


@click.command(
    epilog=example("pilotfish tasks", "pilotfish record carabiner --demonstrations 4 --seed 0 --out hooking")
)
@click.argument("task")
@click.option(
    "--demonstrations",
    type=click.IntRange(1, 10_000),
    default=8,
    show_default=True,
    help="How many showings.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of all chance.")
@click.option(
    "--delay",
    type=click.FloatRange(min=0.0, max=10.0),
    callback=finite,
    default=0.0,
    show_default=True,
    help="How late the person sees what the tool does [s].",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="The folder to write.  [default: named after the task]"
)
@click.option("--force", is_flag=True, help="Replace a folder of demonstrations that is there already.")
@answering
def record(task: str, demonstrations: int, seed: int, delay: float, **files: Any) -> Answer:
    """Record showings of TASK, each in a situation of its own, as a folder that learn reads.

    A simulated person leads one arm of the robot, the other follows and does the work in physics. The same
    seed gives the same recordings, bit for bit. A showing that does not do the work is shown again.
    """
    require_mujoco()
    from pilotfish.station.recorder import shown  # needs MuJoCo

    wanted = task_named(task)
    folder, force = files["out"] or Path(task), files["force"]
    require_new_folder(folder, force=force)
    made = []
    for recording, tries in shown(wanted, demonstrations, seed, delay=delay):
        made.append((recording, tries))
        if a_person_watches():
            remark(f"shown {len(made)} of {demonstrations}, {recording.seconds:.1f} s")
    write_folder([recording.demonstration for recording, _ in made], folder, overwrite=force, beside=True)
    facts = {
        "folder": str(folder),
        "task": task,
        "seed": seed,
        "delay": delay,
        "demonstrations": [_facts(recording, tries) for recording, tries in made],
    }
    return Answer(f"{_shown(made, wanted.unit)}\n\nwritten to {folder}", facts)


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


def _shown(made: "list[tuple[Recording, int]]", unit: str) -> str:
    rows = [
        (
            recording.demonstration.name,
            f"{recording.seconds:.1f}",
            str(len(recording.demonstration.x)),
            f"{recording.verdict.error:.2g}",
            f"{recording.peaks['tool']:.0f}",
            str(tries),
        )
        for recording, tries in made
    ]
    return table(("name", "seconds", "rows", f"error [{unit}]", "largest force [N]", "tries"), rows)


def _facts(recording: "Recording", tries: int) -> dict[str, object]:
    return {
        "name": recording.demonstration.name,
        "seconds": recording.seconds,
        "rows": len(recording.demonstration.x),
        "error": recording.verdict.error,
        "peaks": recording.peaks,
        "tries": tries,
    }
