"""Five tasks in physics: skills from 8 and from 4 demonstrations, performed in new situations.

    python reproductions/tasks.py --json tasks.json --out tasks/

A simulated person demonstrates each task by guiding the left arm of a simulated Baxter, and the right arm
follows. A skill is learned with four covariance structures. It is adapted to twenty new situations, planned,
tracked, and performed in the same physics by impedance control at 1 kHz.

The table gives the number of successes, the median final error in the task's unit, the median of the largest
force on the tool, and the median duration. "streaming" learns half of the demonstrations as a batch and the
others point by point. Numbers of states were chosen on other seeds than the default of 1. The demonstrations
are simulated.

Source: Tanwani 2018, the tasks of sections 3.4, 4.3.2, 5.7.2 and 6.1; the table has no counterpart there.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from protocol import argument_parser, write_figures, write_numbers
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.environments import TASKS, Task
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.simulation import ExecutionResult, perform, record_demonstrations, situation_from_seed

STATES = {"valve": 7, "plate": 9, "stab": 6, "screwdriver": 6, "carabiner": 6}
STRUCTURES = ("full", "semi-tied", "MFA(2)", "streaming")
NUMBERS = (8, 4)
SITUATIONS = 20
EXPLAINED = 0.98  # share of the variance in the subspaces of a stream
COLOURS = ("#004488", "#DDAA33", "#BB5566", "#44AA99")


@dataclass(frozen=True, slots=True)
class Row:
    """Results of one task, structure and number of demonstrations."""

    task: str
    structure: str
    demonstrations: int
    succeeded: int
    situations: int
    error: float
    unit: str
    force: float
    seconds: float
    failures: dict[int, str]


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tasks", nargs="+", default=list(STATES), choices=list(STATES), help="which tasks")
    parser.add_argument("--structures", nargs="+", default=STRUCTURES, choices=STRUCTURES)
    parser.add_argument(
        "--demonstrations", nargs="+", type=int, default=NUMBERS, help="numbers of demonstrations"
    )
    parser.add_argument("--situations", type=int, default=SITUATIONS, help="number of new situations")
    parser.add_argument("--seed", type=int, default=1, help="seed of demonstrations and situations")
    arguments = parser.parse_args()
    rows = []
    for name in arguments.tasks:
        print_rows(task_rows := evaluate_task(TASKS[name], arguments))
        rows += task_rows
    if arguments.out:
        write_figures(arguments.out, {"tasks": draw_successes(rows)})
    if arguments.json:
        write_numbers(arguments.json, [asdict(row) for row in rows])


def evaluate_task(task: Task[Any], arguments: argparse.Namespace) -> list[Row]:
    """Learn and evaluate all skills of a task."""
    demonstrations = load_demonstrations(task.name, max(arguments.demonstrations), arguments.seed)
    rows = []
    for number in arguments.demonstrations:
        for structure in arguments.structures:
            skill = learn_skill(demonstrations[:number], structure, STATES[task.name])
            steps = round(float(np.mean([len(d.x) for d in demonstrations[:number]])))
            row = evaluate_skill(task, (structure, number), (skill, steps), arguments)
            rows.append(row)
    return rows


def load_demonstrations(name: str, number: int, seed: int) -> tuple[Demonstration, ...]:
    """Return demonstrations of a task, with derivatives."""

    def make() -> list[Demonstration]:
        recordings = record_demonstrations(TASKS[name], number, seed)
        bar = tqdm(recordings, f"{name}: recording", number, disable=not sys.stderr.isatty())
        return [recording.demonstration for recording, _ in bar]

    demonstrations = cached_recording(__file__, f"{name}, {number} demonstrations, seed {seed}", make)
    return tuple(map(pf.add_derivatives, demonstrations))


def learn_skill(demonstrations: Sequence[Demonstration], structure: str, states: int) -> pf.Skill:
    """Learn a skill with a named structure."""
    rng = np.random.default_rng(0)
    if structure == "streaming":
        return learn_from_stream(demonstrations, states, rng)
    structures: dict[str, CovarianceStructure] = {
        "full": pf.structures.Full(),
        "semi-tied": pf.structures.SemiTied(),
        "MFA(2)": pf.structures.MFA(2),
    }
    return pf.learn(demonstrations, states=states, rng=rng, structure=structures[structure]).skill


def learn_from_stream(
    demonstrations: Sequence[Demonstration], states: int, rng: np.random.Generator
) -> pf.Skill:
    """Learn half as a batch and half point by point, with columns at one scale for the stream's noise."""
    half = len(demonstrations) // 2
    unscaled = pf.learn(demonstrations[:half], states=states, rng=rng).skill
    scales = pf.online.column_scales(unscaled)
    scaled = [pf.online.scale_demonstration(d, scales, unscaled) for d in demonstrations]
    first, later = scaled[:half], scaled[half:]
    batch = pf.learn(first, states=states, rng=rng).skill
    penalties = pf.online.estimate_penalties(batch, first, explained_variance=EXPLAINED, scales=False)
    model = pf.online.from_batch_fit(batch, first, penalties)
    for demonstration in later:
        model, _ = pf.online.observe_demonstration(model, demonstration)
    return pf.online.unscale_skill(pf.online.to_skill(model), scales, unscaled.layout)


def evaluate_skill(
    task: Task[Any], case: tuple[str, int], learned: tuple[pf.Skill, int], arguments: argparse.Namespace
) -> Row:
    """Perform a skill in the test situations of a task."""
    (structure, number), (skill, steps) = case, learned
    label = f"{task.name}: {structure}, {number} demonstrations"
    situations = [situation_from_seed(task, "test", arguments.seed, n) for n in range(arguments.situations)]
    bar = tqdm(situations, label, leave=False, disable=not sys.stderr.isatty())
    results = [perform(skill, task, situation, horizon=steps) for situation in bar]
    return Row(
        task=task.name,
        structure=structure,
        demonstrations=number,
        succeeded=sum(result.outcome.success for result in results),
        situations=len(results),
        error=median(results, lambda result: result.outcome.error),
        unit=task.unit,
        force=median(results, lambda result: result.peak_forces["tool"]),
        seconds=median(results, lambda result: result.duration),
        failures={n: r.outcome.reason for n, r in enumerate(results) if not r.outcome.success},
    )


def median(results: Sequence[ExecutionResult], value: Callable[[ExecutionResult], float]) -> float:
    """Return the median of a value of the results."""
    return float(np.median([value(result) for result in results]))


def print_rows(rows: Sequence[Row]) -> None:
    print(f"{'task':<12} {'structure':<10} {'shown':>5} {'done':>9} {'error':>12} {'force':>8} {'time':>7}")
    for row in rows:
        done = f"{row.succeeded:>3} of {row.situations:<2}"
        print(
            f"{row.task:<12} {row.structure:<10} {row.demonstrations:>5} {done}"
            f" {row.error:>8.2g} {row.unit:<3} {row.force:>6.1f} N {row.seconds:>5.1f} s"
        )
        if row.failures:
            first, reason = next(iter(row.failures.items()))
            print(f"{'':<12} not done: {', '.join(map(str, row.failures))}; of {first}: {reason}")


def draw_successes(rows: Sequence[Row]) -> Figure:
    """Draw the successes of each task by structure, one panel for each number of demonstrations."""
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    tasks = list(dict.fromkeys(row.task for row in rows))
    structures = list(dict.fromkeys(row.structure for row in rows))
    numbers = list(dict.fromkeys(row.demonstrations for row in rows))
    width = 0.8 / len(structures)
    panels = figure.subplots(len(numbers), 1, sharex=True, squeeze=False)[:, 0]
    for axes, number in zip(panels, numbers, strict=True):
        for s, structure in enumerate(structures):
            chosen = {r.task: r for r in rows if (r.structure, r.demonstrations) == (structure, number)}
            heights = [chosen[task].succeeded for task in tasks]
            positions = np.arange(len(tasks)) + (s - (len(structures) - 1) / 2) * width
            axes.bar(
                positions, heights, 0.92 * width, label=structure, color=COLOURS[STRUCTURES.index(structure)]
            )
        axes.set_title(f"{number} demonstrations", fontsize=10)
        axes.set_ylabel(f"done, of {rows[0].situations}")
        axes.set_ylim(0, rows[0].situations * 1.05)
        axes.set_xticks(np.arange(len(tasks)), tasks)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=len(structures))
    return figure


if __name__ == "__main__":
    main()
