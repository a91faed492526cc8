"""Five tasks in physics: skills from 8 and from 4 demonstrations, carried out in situations never shown.

    python reproductions/tasks.py --json tasks.json --out tasks/

A simulated person shows each task by leading the left arm of a simulated Baxter; the right arm follows and
does the work. From what was recorded a skill is learned with four structures of its covariances, adapted to
twenty unseen situations, planned, tracked, and carried out in the same physics by springs and dampers at
1 kHz.

The table tells how many of the twenty did the work, the median error at the end in the task's unit, the
median of the largest force on the tool, and the median time. "streaming" began from a batch of half of the
demonstrations and learned the other half datapoint by datapoint. States were chosen on other seeds than the
one given (1 by default). No person and no robot made these demonstrations.

Source: Tanwani 2018, the tasks of sections 3.4, 4.3.2, 5.7.2 and 6.1; the table has no counterpart there.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
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
EXPLAINED = 0.98  # of the variance, by the subspaces of a stream
COLOURS = ("#004488", "#DDAA33", "#BB5566", "#44AA99")


@dataclass(frozen=True, slots=True)
class Row:
    """One task, structure and number of demonstrations: how often it worked, and how well."""

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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the table's numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures")
    parser.add_argument("--tasks", nargs="+", default=list(STATES), choices=list(STATES), help="which tasks")
    parser.add_argument("--structures", nargs="+", default=STRUCTURES, choices=STRUCTURES)
    parser.add_argument("--shown", nargs="+", type=int, default=NUMBERS, help="how many demonstrations")
    parser.add_argument("--situations", type=int, default=SITUATIONS, help="how many unseen situations")
    parser.add_argument("--seed", type=int, default=1, help="seed of demonstrations and situations")
    arguments = parser.parse_args()
    rows = []
    for name in arguments.tasks:
        print_rows(made := rows_of(TASKS[name], arguments))
        rows += made
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        picture(rows).savefig(arguments.out / "tasks.png", dpi=110)
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")


def rows_of(task: Task[Any], arguments: argparse.Namespace) -> list[Row]:
    demonstrations = load_demonstrations(task.name, max(arguments.shown), arguments.seed)
    rows = []
    for number in arguments.shown:
        for structure in arguments.structures:
            skill = learn_skill(demonstrations[:number], structure, STATES[task.name])
            steps = round(float(np.mean([len(d.x) for d in demonstrations[:number]])))
            row = evaluate_skill(task, (structure, number), (skill, steps), arguments)
            rows.append(row)
    return rows


def load_demonstrations(name: str, number: int, seed: int) -> tuple[Demonstration, ...]:
    """Return demonstrations of a task, with their speeds."""

    def make() -> list[Demonstration]:
        made = record_demonstrations(TASKS[name], number, seed)
        bar = tqdm(made, f"{name}: showing", number, disable=not sys.stderr.isatty())
        return [recording.demonstration for recording, _ in bar]

    demonstrations = cached_recording(__file__, f"{name}, {number} demonstrations, seed {seed}", make)
    return tuple(map(pf.add_derivatives, demonstrations))


def learn_skill(demonstrations: Sequence[Demonstration], structure: str, states: int) -> pf.Skill:
    rng = np.random.default_rng(0)
    if structure == "streaming":
        return learn_from_stream(demonstrations, states, rng)
    kinds: dict[str, CovarianceStructure] = {
        "full": pf.structures.Full(),
        "semi-tied": pf.structures.SemiTied(),
        "MFA(2)": pf.structures.MFA(2),
    }
    return pf.learn(demonstrations, states=states, rng=rng, structure=kinds[structure]).skill


def learn_from_stream(
    demonstrations: Sequence[Demonstration], states: int, rng: np.random.Generator
) -> pf.Skill:
    """Half at once, the other half datapoint by datapoint, columns at one scale: a stream has one noise."""
    half = len(demonstrations) // 2
    unscaled = pf.learn(demonstrations[:half], states=states, rng=rng).skill
    scales = pf.online.column_scales(unscaled)
    scaled = [pf.online.scale_demonstration(d, scales, unscaled) for d in demonstrations]
    first, later = scaled[:half], scaled[half:]
    batch = pf.learn(first, states=states, rng=rng).skill
    penalties = pf.online.estimate_penalties(batch, first, explained_variance=EXPLAINED)
    model = pf.online.from_batch_fit(batch, first, penalties)
    for demonstration in later:
        model, _ = pf.online.observe_demonstration(model, demonstration)
    return pf.online.unscale_skill(pf.online.to_skill(model), scales, unscaled.layout)


def evaluate_skill(
    task: Task[Any], what: tuple[str, int], learn_skill: tuple[pf.Skill, int], arguments: argparse.Namespace
) -> Row:
    (structure, number), (skill, steps) = what, learn_skill
    label = f"{task.name}: {structure}, {number} shown"
    unseen = [situation_from_seed(task, "test", arguments.seed, n) for n in range(arguments.situations)]
    bar = tqdm(unseen, label, leave=False, disable=not sys.stderr.isatty())
    done = [perform(skill, task, where, horizon=steps) for where in bar]
    return Row(
        task=task.name,
        structure=structure,
        demonstrations=number,
        succeeded=sum(made.outcome.success for made in done),
        situations=len(done),
        error=median(done, lambda made: made.outcome.error),
        unit=task.unit,
        force=median(done, lambda made: made.peak_forces["tool"]),
        seconds=median(done, lambda made: made.duration),
        failures={n: made.outcome.reason for n, made in enumerate(done) if not made.outcome.success},
    )


def median(done: Sequence[ExecutionResult], of: Callable[[ExecutionResult], float]) -> float:
    return float(np.median([of(made) for made in done]))


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


def picture(rows: Sequence[Row]) -> Figure:
    """How many situations of each task were done, by structure; 8 demonstrations above, 4 below."""
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
            places = np.arange(len(tasks)) + (s - (len(structures) - 1) / 2) * width
            axes.bar(
                places, heights, 0.92 * width, label=structure, color=COLOURS[STRUCTURES.index(structure)]
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
