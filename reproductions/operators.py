"""Simulated operators in physics: tasks completed with a displaced view, and continued autonomously.

    python reproductions/operators.py --json operators.json --out operators/

A skill is learned at defaults from six demonstrations of a simulated person, and the gate of the authority is
calibrated on them. In unseen situations another simulated person operates the remote robot, with the
parameters of `HumanModel()` as they are. The objects in the operator's local scene are displaced in a random
horizontal direction, or turned about the vertical. There is no delay; a scene at rest looks the same later.

    direct      the robot follows the operator
    literal     equations 6.4-6.9
    carried     shared control, the default
    fixture     guided along the path that was learned from the demonstrations
    autonomous  takes over from carried at a random instant of the motion, and finishes; the view is not off
    returned    the same, and the operator takes control back after a second

The table gives the number of completed situations.

Source: Tanwani 2018, sections 6.3 and 6.5 (the protocol is ours).
"""

import argparse
import sys
from collections.abc import Callable
from math import radians
from typing import Any

import numpy as np
from assistance import load_demonstrations, make_assistant
from matplotlib.figure import Figure
from protocol import Row, argument_parser, write_figures, write_numbers
from tqdm import tqdm

from pilotfish.assistance import Assistant
from pilotfish.environments import TASKS
from pilotfish.simulation import Link, TeleoperationResult, situation_from_seed, teleoperate

NAMES = ("stab", "carabiner", "valve")
MODES = ("direct", "literal", "carried", "fixture")
TRAINING = 6
VIEWS = {
    "0 cm": Link(),
    "1 cm": Link(view_distance=0.01),
    "3 cm": Link(view_distance=0.03),
    "5 cm": Link(view_distance=0.05),
    "10 degrees": Link(view_angle=radians(10.0)),
}
EARLIEST, LATEST = 0.05, 0.75  # instants of a switch, of the duration of the operator's own motion
RETURN_AFTER = 1.0  # s


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tasks", nargs="+", default=NAMES, choices=NAMES, help="which tasks")
    parser.add_argument("--views", nargs="+", default=list(VIEWS), choices=list(VIEWS), help="which views")
    parser.add_argument("--modes", nargs="+", default=MODES, choices=MODES, help="which modes")
    parser.add_argument("--situations", type=int, default=20, help="number of situations of each")
    parser.add_argument("--seed", type=int, default=0, help="seed of demonstrations and situations")
    arguments = parser.parse_args()
    rows: list[Row] = []
    for name in arguments.tasks:
        training = list(load_demonstrations(name, arguments.seed)[:TRAINING])
        assistants = {
            mode: make_assistant(training, literal=mode == "literal", limited=True)
            for mode in arguments.modes
        }
        for mode, assistant in assistants.items():
            rows += [evaluate_view(name, mode, assistant, view, arguments) for view in arguments.views]
        if "carried" in assistants:
            rows += evaluate_autonomous(name, assistants["carried"], arguments)
    if arguments.out:
        write_figures(arguments.out, {"completed": draw_completed(rows, arguments.situations)})
    if arguments.json:
        write_numbers(arguments.json, {"rows": rows})


def evaluate_view(
    name: str, mode: str, assistant: Assistant, view: str, arguments: argparse.Namespace
) -> Row:
    """Return the number of situations completed with one view."""
    control = mode if mode in ("direct", "fixture") else "shared"
    results = [
        operate(name, number, assistant, arguments, mode=control, link=VIEWS[view])
        for number in tqdm(
            range(arguments.situations), f"{name}, {mode}, {view}", disable=not sys.stderr.isatty()
        )
    ]
    return summarise(name, mode, view, results)


def evaluate_autonomous(name: str, assistant: Assistant, arguments: argparse.Namespace) -> list[Row]:
    """Return the numbers of situations completed after a switch, without and with a return."""
    found: dict[str, list[TeleoperationResult]] = {"autonomous": [], "returned": []}
    for number in tqdm(range(arguments.situations), f"{name}, autonomous", disable=not sys.stderr.isatty()):
        alone = operate(name, number, assistant, arguments, mode="shared", link=Link())
        share = np.random.default_rng([arguments.seed, number, 2]).uniform(EARLIEST, LATEST)
        instant = share * alone.duration
        for key, end in (("autonomous", np.inf), ("returned", instant + RETURN_AFTER)):
            mode = switch_between(instant, end)
            found[key].append(operate(name, number, assistant, arguments, mode=mode, link=Link()))
    return [summarise(name, key, "0 cm", results) for key, results in found.items()]


def switch_between(start: float, end: float) -> Callable[[float], str]:
    """Return the mode at a time: autonomous from start to end, shared otherwise."""
    return lambda time: "autonomous" if start <= time < end else "shared"


def operate(
    name: str, number: int, assistant: Assistant, arguments: argparse.Namespace, **options: Any
) -> TeleoperationResult:
    """Operate in one situation; the operator's noise is the same in every mode."""
    task = TASKS[name]
    situation = situation_from_seed(task, "test", arguments.seed, number)
    rng = np.random.default_rng([arguments.seed, number, 1])
    return teleoperate(assistant, task, situation, rng, **options)


def summarise(name: str, mode: str, view: str, results: list[TeleoperationResult]) -> Row:
    """Return the successes, the fastest target, and print them."""
    steps = [np.linalg.norm(np.diff(result.targets[:, :3], axis=0), axis=1).max() for result in results]
    row: Row = {
        "task": name,
        "mode": mode,
        "view": view,
        "completed": sum(result.outcome.success for result in results),
        "of": len(results),
        "largest step [mm]": 1000.0 * float(max(steps)),
        "authority": float(np.mean([result.authority.mean() for result in results])),
    }
    print(
        "  ".join(
            f"{key} {value:.3g}" if isinstance(value, float) else f"{value}" for key, value in row.items()
        )
    )
    sys.stdout.flush()
    return row


def draw_completed(rows: list[Row], situations: int) -> Figure:
    """Return bars of completed situations for each task, view and mode."""
    names = list(dict.fromkeys(row["task"] for row in rows))
    figure = Figure(figsize=(3.6 * len(names), 3.2), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        chosen = [row for row in rows if row["task"] == name and row["mode"] in MODES]
        views = list(dict.fromkeys(row["view"] for row in chosen))
        for n, mode in enumerate(MODES):
            counts = [
                row["completed"]
                for view in views
                for row in chosen
                if (row["mode"], row["view"]) == (mode, view)
            ]
            if counts:
                axes.bar(np.arange(len(counts)) + 0.2 * (n - 1.5), counts, 0.18, label=mode)
        axes.set(title=name, xticks=np.arange(len(views)), xticklabels=views, xlabel="view off by")
        axes.set(ylabel=f"completed of {situations}", ylim=(0, 1.05 * situations))
        axes.legend()
    return figure


if __name__ == "__main__":
    main()
