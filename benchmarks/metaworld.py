"""Meta-World: success of learned skills in new situations, from five demonstrations of a scripted expert.

Each method gets the same demonstrations and the same situations, and answers with commands of hand and
gripper. The suite executes them through its own action interface and judges success. It needs another MuJoCo,
so it runs in its own environment, which the first run creates; metaworld_suite.py is the process there, and
metaworld_methods.py holds the methods. Demonstrations are recorded once and kept.

    python benchmarks/metaworld.py                          # tasks at even places of the alphabet, draw 0
    python benchmarks/metaworld.py --tasks assembly-v3 hammer-v3 --methods ours,nearest
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from machine import machine
from metaworld_methods import BASIS_FUNCTIONS, METHODS, Episode, Situation, commands_of_path
from peer_environment import execute, peer_environment
from problems import Floats

import pilotfish as pf

HERE = Path(__file__).parent
BUILD = HERE.parent / "build" / "metaworld"
DOCUMENT = HERE.parent / "docs" / "benchmarks-metaworld.md"
PACKAGES = HERE / "metaworld-constraints.txt"
DEMONSTRATIONS, SITUATIONS = 5, 20
GOOD, POOR = 90.0, 70.0  # percent: tasks that are counted, and tasks that are listed
EXPERTS = {"expert": "scripted expert", "replay": "replay of the expert's commands in the same situation"}
NAMES = EXPERTS | {name: title for name, (title, _) in METHODS.items()}


@dataclass(frozen=True, slots=True)
class Settings:
    """Choices of a run.

    Attributes:
        python: Python of the suite's environment.
        data: Folder of the recordings.
        situations: Number of new situations for each task.
        methods: Names of the methods.
        steps_per_row: Steps of the suite for each row of a demonstration.
    """

    python: Path
    data: Path
    situations: int
    methods: tuple[str, ...]
    steps_per_row: int


@dataclass(frozen=True, slots=True)
class Result:
    """Success of a method in one task.

    Attributes:
        task: Name of the task.
        draw: Number of the draw of demonstrations and situations.
        method: Name of the method.
        succeeded: Success in each situation.
        seconds: CPU time of learning and of all reproductions.
        error: Why the method gave no commands; empty if it did.
    """

    task: str
    draw: int
    method: str
    succeeded: tuple[bool, ...]
    seconds: float
    error: str = ""

    @property
    def percent(self) -> float:
        """Success in percent."""
        return 100.0 * sum(self.succeeded) / len(self.succeeded)


def main() -> None:
    """Record what is missing, measure, print the tables."""
    options = arguments()
    python, failures = peer_environment(options.environment, PACKAGES, execute)
    if failures:
        raise SystemExit(f"Meta-World cannot be installed: {failures}")
    settings = Settings(
        python.absolute(),
        options.data.absolute(),
        options.situations,
        tuple(options.methods),
        options.steps_per_row,
    )
    results: list[Result] = []
    with ProcessPoolExecutor(options.workers) as pool:
        listed = pool.submit(request_answer, settings.python, {"do": "list"}).result()["tasks"]
        jobs = [(task, draw) for task in chosen_tasks(options.tasks, listed) for draw in options.draws]
        for found in pool.map(partial(measure, settings), *zip(*jobs, strict=True)):
            results += found
            print_progress(found)
    page = document(results, settings, repeatable_options(sys.argv[1:]))
    print(page)
    if options.out:
        options.out.write_text(page + "\n", encoding="utf-8")
    if options.json:
        options.json.write_text(json.dumps([asdict(result) for result in results]), encoding="utf-8")


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tasks", nargs="+", default=["even"], help="names, or even, odd, all: places in the alphabet"
    )
    parser.add_argument("--draws", type=numbers, default=[0], help="numbers with commas (default 0)")
    parser.add_argument("--situations", type=int, default=SITUATIONS, help="new situations for each task")
    parser.add_argument("--methods", type=method_names, default=list(NAMES), help=f"of {','.join(NAMES)}")
    parser.add_argument("--steps-per-row", type=int, choices=[1, 2, 4], default=1, help="1: rows at 80 Hz")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--data", type=Path, default=BUILD / "data", help="folder of the recordings")
    parser.add_argument("--environment", type=Path, default=BUILD / "venv", help="environment of the suite")
    parser.add_argument("--out", type=Path, help=f"file for the page, such as docs/{DOCUMENT.name}")
    parser.add_argument("--json", type=Path, help="file for all figures")
    options = parser.parse_args()
    if not 1 <= options.situations <= SITUATIONS:
        parser.error(f"--situations is {options.situations}, expected 1 to {SITUATIONS}, which are recorded")
    return options


def repeatable_options(words: Sequence[str]) -> str:
    """Return the options that determine the figures, without those that name files and folders."""
    places = {"--data", "--environment", "--out", "--json", "--workers"}
    kept, skip = [], False
    for word in words:
        skip = skip or word.split("=")[0] in places
        if not skip:
            kept.append(word)
        skip = skip and word in places
    return " ".join(kept)


def numbers(text: str) -> list[int]:
    """Parse numbers with commas between them."""
    return [int(number) for number in text.split(",")]


def method_names(text: str) -> list[str]:
    """Parse names of methods with commas between them."""
    names = text.split(",")
    if unknown := [name for name in names if name not in NAMES]:
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}: expected some of {','.join(NAMES)}")
    return names


def chosen_tasks(words: Iterable[str], tasks: Iterable[str]) -> list[str]:
    """Return the tasks of names and of the words even, odd and all, in the order of the alphabet."""
    ordered = sorted(tasks)
    groups = {"even": ordered[::2], "odd": ordered[1::2], "all": ordered}
    chosen = {task for word in words for task in groups.get(word, [word])}
    if unknown := sorted(chosen - set(ordered)):
        raise SystemExit(
            f"no task is called {', '.join(unknown)}, expected even, odd, all or some of {', '.join(ordered)}"
        )
    return [task for task in ordered if task in chosen]


def measure(settings: Settings, task: str, draw: int) -> list[Result]:
    """Measure all methods in one task."""
    file = settings.data / f"{task}-{draw}.npz"
    if not file.exists():
        counts = {"demonstrations": DEMONSTRATIONS, "situations": SITUATIONS}
        request = {"do": "record", "task": task, "draw": draw, "file": str(file)}
        request_answer(settings.python, request | counts)
    demonstrations, tests = read_episodes(file)
    tests = tests[: settings.situations]
    seeds = [test.situation.seed for test in tests]
    results = []
    for name in settings.methods:
        before = process_time()
        if name == "expert":
            results.append(Result(task, draw, name, tuple(test.succeeded for test in tests), 0.0))
            continue
        try:
            commands = method_commands(name, demonstrations, tests, settings.steps_per_row, draw)
        except pf.SkillError as error:
            results.append(Result(task, draw, name, (False,) * len(tests), 0.0, str(error)))
            continue
        seconds = process_time() - before
        succeeded = execute_in_suite(settings.python, task, seeds, commands)
        results.append(Result(task, draw, name, succeeded, seconds))
    return results


def method_commands(
    name: str, demonstrations: Sequence[Episode], tests: Sequence[Episode], steps_per_row: int, seed: int
) -> list[Floats]:
    """Return the commands of a method in each situation, at the suite's rate."""
    if name == "replay":
        return [test.commands for test in tests]
    reproduce = METHODS[name][1](demonstrations, steps_per_row, seed)
    return [commands_of_path(reproduce(test.situation), steps_per_row) for test in tests]


def read_episodes(file: Path) -> tuple[list[Episode], list[Episode]]:
    """Read the demonstrations, and the expert's episodes in new situations."""

    def episodes(name: str) -> list[Episode]:
        fields = [arrays[f"{name}_{field}"] for field in ("seed", "hand", "object", "goal", "succeeded")]
        return [
            Episode(
                Situation(int(seed), hand, position, goal),
                arrays[f"{name}_commands_{number}"],
                bool(succeeded),
            )
            for number, (seed, hand, position, goal, succeeded) in enumerate(zip(*fields, strict=True))
        ]

    with np.load(file) as arrays:
        return episodes("demonstration"), episodes("situation")


def execute_in_suite(
    python: Path, task: str, seeds: Sequence[int], commands: Sequence[Floats]
) -> tuple[bool, ...]:
    """Execute commands in situations of the suite and return the successes."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "commands.npz"
        arrays: dict[str, Any] = {f"commands_{number}": rows for number, rows in enumerate(commands)}
        np.savez(file, **arrays)
        request = {"do": "execute", "task": task, "seeds": list(seeds), "file": str(file)}
        answer = request_answer(python, request)
    return tuple(answer["succeeded"])


def request_answer(python: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Send a request to the suite's process and return its answer."""
    process = suite_process(python)
    assert process.stdin
    assert process.stdout
    process.stdin.write(json.dumps(request) + "\n")
    process.stdin.flush()
    line = process.stdout.readline()
    if not line:
        raise SystemExit(f"the process of Meta-World ended at {request}; its error is printed above")
    answer: dict[str, Any] = json.loads(line)
    if answer.get("error"):
        raise SystemExit(answer["error"])
    return answer


@cache
def suite_process(python: Path) -> "subprocess.Popen[str]":
    """Start the suite's process, one for each process of the benchmark; it ends with its input."""
    command = [str(python), "-P", "-W", "ignore", str(HERE / "metaworld_suite.py")]
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=variables)


def print_progress(results: Sequence[Result]) -> None:
    """Print the successes of a task."""
    figures = "  ".join(
        f"{result.method} {result.percent:3.0f} ({result.seconds:.1f} s)" for result in results
    )
    print(f"{results[0].task:30} {results[0].draw}  {figures}", file=sys.stderr, flush=True)
    for error in {result.error for result in results} - {""}:
        print(f"    {error}", file=sys.stderr, flush=True)


def document(results: Sequence[Result], settings: Settings, options: str) -> str:
    """Return the page of all figures."""
    computer = machine()
    command = f"python benchmarks/metaworld.py {options}".strip()
    tasks = {result.task for result in results}
    draws = sorted({result.draw for result in results})
    listed = ", ".join(map(str, draws))
    counts = f"{len(tasks)} tasks, {settings.situations} new situations each, draw {listed}"
    rate = 80 // settings.steps_per_row
    packages = dict(line.split("==") for line in PACKAGES.read_text(encoding="utf-8").split())
    with_versions = f"metaworld {packages['metaworld']}, MuJoCo {packages['mujoco']}"
    return "\n".join(
        [
            "# Benchmark on Meta-World",
            "",
            f"Written on {datetime.now(UTC):%Y-%m-%d} by `{command}`: {counts}.",
            PROTOCOL.format(rate=rate, versions=with_versions, basis=BASIS_FUNCTIONS),
            *summary(results),
            "",
            "## Tasks",
            "",
            "Success in percent.",
            "",
            *task_rows(results),
            "",
            "## Machine",
            "",
            f"{computer.processor}, {computer.cores} cores, {computer.memory_gb:.0f} GB, {computer.system}.",
        ]
    )


PROTOCOL = """
[Meta-World](https://meta-world.github.io) ({versions}) has fifty tasks of one arm. For each task and draw, \
the suite's scripted expert gives five demonstrations that succeed. They hold the commanded position of the \
hand and the command of the gripper at {rate} Hz. Frames are the world, the object and the goal at the \
start, without rotation. Each method begins at the hand's position and answers with commands. The suite \
executes them without feedback, holds the last one for half a second, and judges success.

- *Pilotfish* learns and reproduces at defaults.
- The *expert* observes every step. The *replay* executes the expert's commands again, without observation.
- The *nearest* demonstration is that of the nearest situation. It is shifted at the start, at the object \
and at the end, as hand, object and goal moved.
- The *mean* over relative time is shifted at the start and at the end.
- *ProMP* conditions the weights of {basis} basis functions per axis on hand, object and goal.

Tasks are in the order of the alphabet. The library is developed on those at even places; those at odd \
places are for checking only. Demonstrations, situations and answers follow from the number of the draw, so \
that a run can be repeated exactly on the same machine.

## Success
"""


def summary(results: Sequence[Result]) -> list[str]:
    """Return one row per method: the mean over tasks, that of each draw, counts of tasks, CPU time."""
    lines = [
        f"| method | success % | each draw | tasks >= {GOOD:.0f} % | tasks < {POOR:.0f} % | CPU s per task |",
        "| --- | ---: | --- | ---: | ---: | ---: |",
    ]
    for name in dict.fromkeys(result.method for result in results):
        own = [result for result in results if result.method == name]
        by_draw, by_task = means(own, "draw"), means(own, "task")
        shares = list(by_task.values())
        good, poor = sum(share >= GOOD for share in shares), sum(share < POOR for share in shares)
        spread = ", ".join(f"{share:.1f}" for share in by_draw.values())
        seconds = "" if name in EXPERTS else f"{np.mean([result.seconds for result in own]):.2f}"
        lines.append(f"| {NAMES[name]} | {np.mean(shares):.1f} | {spread} | {good} | {poor} | {seconds} |")
    return lines


def task_rows(results: Sequence[Result]) -> list[str]:
    """Return one row per task with the success of each method."""
    methods = list(dict.fromkeys(result.method for result in results))
    lines = [f"| task | {' | '.join(methods)} |", f"| --- |{' ---: |' * len(methods)}"]
    by_method = {
        name: means([result for result in results if result.method == name], "task") for name in methods
    }
    for task in sorted({result.task for result in results}):
        figures = " | ".join(f"{by_method[name][task]:.0f}" for name in methods)
        lines.append(f"| {task.removesuffix('-v3')} | {figures} |")
    return lines


def means(results: Iterable[Result], field: str) -> dict[Any, float]:
    """Return the mean success in percent for each value of a field."""
    groups: dict[Any, list[float]] = defaultdict(list)
    for result in results:
        groups[getattr(result, field)].append(result.percent)
    return {value: float(np.mean(group)) for value, group in sorted(groups.items())}


if __name__ == "__main__":
    main()
