"""The measurement itself: every library's turn, round after round."""

import math
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import quantiles
from time import monotonic
from typing import Any

from cases import LIBRARIES
from kinds import Case, Entry
from workers import Worker, WorkerError, surroundings

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Effort:
    """How often everything is repeated. sample [s] is the least CPU that one sample should hold."""

    rounds: int
    import_rounds: int
    sample: float
    patience: float  # s, after which a case has no more rounds, if it had a few
    iterations: dict[str, int]  # of EM, for each size
    datapoints: dict[str, int]  # of streams, for each size


FEWEST = 3  # rounds, however long they take
FULL = Effort(
    rounds=15,
    import_rounds=9,
    sample=0.02,
    patience=60.0,
    iterations={"valve": 30, "large": 5, "vast": 2, "wide": 4, "visits": 5},
    datapoints={"stream": 5000, "long": 200_000},
)
QUICK = Effort(
    rounds=2,
    import_rounds=1,
    sample=0.0,
    patience=0.0,
    iterations={"valve": 3, "large": 2, "vast": 2, "wide": 2, "visits": 2},
    datapoints={"stream": 500, "long": 5000},
)


@dataclass(frozen=True, slots=True)
class Spread:
    """Samples [s] and where they lie; half of them between lower and upper."""

    median: float
    minimum: float
    lower: float
    upper: float
    samples: tuple[float, ...]


def spread(samples: Sequence[float]) -> Spread:
    twice = [*samples, *samples] if len(samples) == 1 else samples
    lower, middle, upper = quantiles(twice, n=4, method="inclusive")
    return Spread(middle, min(samples), lower, upper, tuple(samples))


@dataclass(frozen=True, slots=True)
class First:
    """The first call in a process that does nothing else [s a unit], and what the process had spent then.

    result is all its CPU [s] until the first result, imports included. peak_mb is the most memory that it
    held, grown_mb by how much more than before the call.
    """

    cpu: float
    wall: float
    result: float
    peak_mb: float
    grown_mb: float


@dataclass(frozen=True, slots=True)
class Result:
    """One entry of a case. failure says why there are no figures, and is empty when there are.

    begin is the answer before the first iteration, where the library told one.
    """

    entry: Entry
    cpu: Spread | None = None
    wall: Spread | None = None
    first: First | None = None
    answer: float = math.nan
    begin: float = math.nan
    remark: str = ""
    failure: str = ""


@dataclass(slots=True)
class _Turns:
    """What an entry has delivered so far."""

    entry: Entry
    call: str
    repeats: int = 1
    first: First | None = None
    replies: list[dict[str, Any]] = field(default_factory=list)
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Floor:
    """Where the libraries live: the python of each, its long-lived worker, and why a library is missing."""

    pythons: Mapping[str, Path]
    workers: Mapping[str, Worker]
    missing: Mapping[str, str]


def measure(case: Case, floor: Floor, problems: Path, effort: Effort, say: Say) -> list[Result]:
    """Every entry's first call in a fresh process, then rounds in which each has its turn: A B C A B C ..."""
    folder = problems / case.problem
    turns = [
        _Turns(entry, f"{case.name}/{entry.label}")
        for entry in case.entries
        if entry.library in floor.pythons
    ]
    for turn in turns:
        say(f"{case.name}: {turn.entry.label}, first call")
        _attempt(turn, partial(_begin, turn, floor, folder, effort))
    began = monotonic()
    for number in range(effort.rounds):
        if number >= FEWEST and monotonic() - began > effort.patience:
            break
        say(f"{case.name}: round {number + 1} of {effort.rounds}")
        for turn in turns:
            _attempt(turn, partial(_take, turn, floor))
    return [_result(turn) for turn in turns]


def _attempt(turn: _Turns, act: Callable[[], None]) -> None:
    if turn.failure:
        return
    try:
        act()
    except WorkerError as error:
        turn.failure = str(error)


def _begin(turn: _Turns, floor: Floor, folder: Path, effort: Effort) -> None:
    """The first call; then one in the long-lived worker, which warms it and tells how many fill a sample."""
    library = turn.entry.library
    if library in floor.missing:
        raise WorkerError(floor.missing[library])
    prepare = {"call": turn.call, "function": turn.entry.function, "folder": str(folder)}
    with Worker(floor.pythons[library], library, surroundings()) as fresh:
        fresh.ask("prepare", **prepare)
        reply = fresh.ask("run", call=turn.call, repeats=1)
    told = ("cpu", "wall", "result", "peak_mb", "grown_mb")
    turn.first = First(*(reply[name] for name in told))
    floor.workers[library].ask("prepare", **prepare)
    warm = floor.workers[library].ask("run", call=turn.call, repeats=1)
    turn.repeats = max(1, min(1000, math.ceil(effort.sample / max(warm["call_cpu"], 1e-6))))


def _take(turn: _Turns, floor: Floor) -> None:
    reply = floor.workers[turn.entry.library].ask("run", call=turn.call, repeats=turn.repeats)
    turn.replies.append(reply)


def _result(turn: _Turns) -> Result:
    if turn.failure:
        return Result(turn.entry, failure=turn.failure)
    cpu, wall = ([reply[name] for reply in turn.replies] for name in ("cpu", "wall"))
    last = turn.replies[-1]
    return Result(
        turn.entry, spread(cpu), spread(wall), turn.first, last["answer"], last["begin"], last["remark"]
    )


def measure_imports(floor: Floor, effort: Effort, say: Say) -> dict[str, Spread]:
    """Wall seconds of `import` of each library, and of NumPy beside it, in fresh processes, by turns."""
    modules = {name: LIBRARIES[name].module for name in floor.pythons if name not in floor.missing}
    samples: dict[str, list[float]] = {name: [] for name in modules}
    for name, module in modules.items():  # once for nothing: bytecode is written, files are in memory
        _import_seconds(floor.pythons[name], module)
    for number in range(effort.import_rounds):
        say(f"import: round {number + 1} of {effort.import_rounds}")
        for name, module in modules.items():
            samples[name].append(_import_seconds(floor.pythons[name], module))
    return {name: spread(taken) for name, taken in samples.items()}


def _import_seconds(python: Path, module: str) -> float:
    program = f"from time import perf_counter as now; t = now(); import {module}; print(now() - t)"
    command = [str(python), "-W", "ignore", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, env=surroundings(), check=False)
    return float(done.stdout.split()[-1]) if done.returncode == 0 else math.nan
