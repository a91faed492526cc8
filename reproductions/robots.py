"""One skill, several arms: skills from Baxter and from the arm itself, performed by other arms in physics.

    python reproductions/robots.py --json robots.json

A simulated person demonstrates each task eight times: by Baxter's left arm, and by the hand alone for an arm
without a second one. A skill is learned from each recording with the defaults of `pilotfish learn`. Each arm
then performs both skills in twenty new situations by impedance control at 1 kHz.

The table gives the number of successes, the median final error in the task's unit, the median of the largest
force on the tool, and the median duration. A situation that the arm does not reach counts as a failure. If a
demonstration fails five times, its reason is printed in place of a row.

The table has no counterpart in Tanwani 2018, where every task is done by Baxter.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from protocol import argument_parser, write_numbers
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.environments import TASKS, Task
from pilotfish.environments.robots import ROBOTS
from pilotfish.errors import SkillError
from pilotfish.simulation import ExecutionResult, perform, record_demonstrations, situation_from_seed

TEACHER = "baxter"
DEMONSTRATIONS, SITUATIONS = 8, 20


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one arm with one skill."""

    robot: str
    task: str
    recorded_on: str
    succeeded: int
    situations: int
    error: float
    unit: str
    force: float
    seconds: float
    failures: dict[int, str]


def main() -> None:
    parser = argument_parser(__doc__)
    others = [name for name in ROBOTS if name != TEACHER]
    parser.add_argument("--robots", nargs="+", default=others, choices=list(ROBOTS), help="which arms")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=list(TASKS), help="which tasks")
    parser.add_argument("--demonstrations", type=int, default=DEMONSTRATIONS, help="number of demonstrations")
    parser.add_argument("--situations", type=int, default=SITUATIONS, help="number of new situations")
    parser.add_argument("--seed", type=int, default=0, help="seed of demonstrations and situations")
    arguments = parser.parse_args()
    rows = []
    for task in arguments.tasks:
        skills: dict[str, tuple[pf.Skill, int]] = {}
        for robot in arguments.robots:
            for teacher in dict.fromkeys((TEACHER, robot)):
                try:
                    if teacher not in skills:
                        skills[teacher] = learn_skill(teacher, task, arguments)
                except SkillError as error:
                    print(f"{robot:<8} {task:<12} skill of {teacher:<8} not recorded: {error}", flush=True)
                    continue
                rows.append(evaluate(robot, TASKS[task], (teacher, *skills[teacher]), arguments))
                print_row(rows[-1])
    if arguments.json:
        write_numbers(arguments.json, [asdict(row) for row in rows])


def learn_skill(robot: str, task: str, arguments: argparse.Namespace) -> tuple[pf.Skill, int]:
    """Return a skill from demonstrations of a robot, and their mean number of steps."""
    demonstrations = load_demonstrations(robot, task, arguments)
    skill = pf.learn(demonstrations, rng=np.random.default_rng(0)).skill
    return skill, round(float(np.mean([len(d.x) for d in demonstrations])))


def load_demonstrations(robot: str, task: str, arguments: argparse.Namespace) -> tuple[Demonstration, ...]:
    """Return demonstrations of a task by a robot, with derivatives."""
    number, seed = arguments.demonstrations, arguments.seed

    def make() -> list[Demonstration]:
        recordings = record_demonstrations(TASKS[task], number, seed, robot=ROBOTS[robot])
        bar = tqdm(recordings, f"{robot}, {task}: recording", number, disable=not sys.stderr.isatty())
        return [recording.demonstration for recording, _ in bar]

    demonstrations = cached_recording(__file__, f"{robot}, {task}, {number}, seed {seed}", make)
    return tuple(map(pf.add_derivatives, demonstrations))


def evaluate(
    robot: str, task: Task[Any], learned: tuple[str, pf.Skill, int], arguments: argparse.Namespace
) -> Row:
    """Perform a skill with a robot in the test situations of a task."""
    teacher, skill, steps = learned
    results: dict[int, ExecutionResult] = {}
    failures: dict[int, str] = {}
    numbers = range(arguments.situations)
    label = f"{robot}, {task.name} from {teacher}"
    for n in tqdm(numbers, label, leave=False, disable=not sys.stderr.isatty()):
        situation = situation_from_seed(task, "test", arguments.seed, n)
        try:
            result = results[n] = perform(skill, task, situation, horizon=steps, robot=ROBOTS[robot])
        except SkillError as error:
            failures[n] = str(error)
            continue
        if not result.outcome.success:
            failures[n] = result.failure.summary if result.failure else result.outcome.reason
    done = list(results.values())
    return Row(
        robot=robot,
        task=task.name,
        recorded_on=teacher,
        succeeded=arguments.situations - len(failures),
        situations=arguments.situations,
        error=median(done, lambda result: result.outcome.error),
        unit=task.unit,
        force=median(done, lambda result: result.peak_forces["tool"]),
        seconds=median(done, lambda result: result.duration),
        failures=failures,
    )


def median(results: Sequence[ExecutionResult], value: Callable[[ExecutionResult], float]) -> float:
    """Return the median of a value of the results; NaN without results."""
    return float(np.median([value(result) for result in results])) if results else float("nan")


def print_row(row: Row) -> None:
    print(
        f"{row.robot:<8} {row.task:<12} skill of {row.recorded_on:<8} {row.succeeded:>3} of "
        f"{row.situations:<3} {row.error:>8.2g} {row.unit:<4} {row.force:>6.1f} N {row.seconds:>5.1f} s",
        flush=True,
    )
    if row.failures:
        first, reason = next(iter(row.failures.items()))
        print(f"{'':<9}not done: {', '.join(map(str, row.failures))}; of {first}: {reason}", flush=True)


if __name__ == "__main__":
    main()
