"""Measurement: first calls in fresh processes, then rounds in which the libraries take turns."""

import math
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import quantiles
from time import monotonic
from typing import Any

from kinds import Case, Entry
from peer_libraries import LIBRARIES
from workers import Worker, WorkerError, timed_environment

Report = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class MeasurementSettings:
    """Numbers of repetitions; sample is the least CPU time of one sample [s]."""

    rounds: int
    import_rounds: int
    sample: float
    time_limit: float  # s, after which a case has no further rounds
    iterations: dict[str, int]  # of EM, for each size
    datapoints: dict[str, int]  # of streams, for each size


MIN_ROUNDS = 3
FULL = MeasurementSettings(
    rounds=15,
    import_rounds=9,
    sample=0.02,
    time_limit=60.0,
    iterations={"valve": 30, "large": 5, "vast": 2, "wide": 4, "semi_markov": 5},
    datapoints={"stream": 5000, "long": 200_000},
)
QUICK = MeasurementSettings(
    rounds=2,
    import_rounds=1,
    sample=0.0,
    time_limit=0.0,
    iterations={"valve": 3, "large": 2, "vast": 2, "wide": 2, "semi_markov": 2},
    datapoints={"stream": 500, "long": 5000},
)


@dataclass(frozen=True, slots=True)
class SampleStatistics:
    """Samples [s] with median, minimum and quartiles."""

    median: float
    minimum: float
    lower: float
    upper: float
    samples: tuple[float, ...]


def sample_statistics(samples: Sequence[float]) -> SampleStatistics:
    """Return the statistics of one or more samples."""
    at_least_two = [*samples, *samples] if len(samples) == 1 else samples
    lower, middle, upper = quantiles(at_least_two, n=4, method="inclusive")
    return SampleStatistics(middle, min(samples), lower, upper, tuple(samples))


@dataclass(frozen=True, slots=True)
class FirstCall:
    """First call in a fresh process.

    Attributes:
        cpu: CPU time per unit of work [s].
        wall: Wall time per unit of work [s].
        result: CPU time of the process until the first result, imports included [s].
        peak_mb: Peak memory [MB].
        grown_mb: Growth of the peak memory by the call [MB].
    """

    cpu: float
    wall: float
    result: float
    peak_mb: float
    grown_mb: float


@dataclass(frozen=True, slots=True)
class Result:
    """Result of one entry of a case.

    Attributes:
        entry: Entry of the case.
        cpu: CPU time per unit of work [s].
        wall: Wall time per unit of work [s].
        first: First call in a fresh process.
        answer: Answer of the last call.
        begin: Answer before the first iteration; NaN if the library does not report it.
        remark: Remark of the library.
        failure: Reason without figures; empty otherwise.
    """

    entry: Entry
    cpu: SampleStatistics | None = None
    wall: SampleStatistics | None = None
    first: FirstCall | None = None
    answer: float = math.nan
    begin: float = math.nan
    remark: str = ""
    failure: str = ""


@dataclass(slots=True)
class _EntryRuns:
    """Replies of an entry so far."""

    entry: Entry
    call: str
    repeats: int = 1
    first: FirstCall | None = None
    replies: list[dict[str, Any]] = field(default_factory=list)
    failure: str = ""


@dataclass(frozen=True, slots=True)
class Installations:
    """Python and worker of each library, and the reason for each missing library."""

    pythons: Mapping[str, Path]
    workers: Mapping[str, Worker]
    missing: Mapping[str, str]


def measure(
    case: Case, installations: Installations, problems: Path, measurement: MeasurementSettings, report: Report
) -> list[Result]:
    """Measure first calls in fresh processes, then rounds in which the entries take turns."""
    folder = problems / case.problem
    turns = [
        _EntryRuns(entry, f"{case.name}/{entry.label}")
        for entry in case.entries
        if entry.library in installations.pythons
    ]
    for turn in turns:
        report(f"{case.name}: {turn.entry.label}, first call")
        _run_or_record_failure(turn, partial(_first_call, turn, installations, folder, measurement))
    start = monotonic()
    for number in range(measurement.rounds):
        if number >= MIN_ROUNDS and monotonic() - start > measurement.time_limit:
            break
        report(f"{case.name}: round {number + 1} of {measurement.rounds}")
        for turn in turns:
            _run_or_record_failure(turn, partial(_measure_round, turn, installations))
    return [_result(turn) for turn in turns]


def _run_or_record_failure(turn: _EntryRuns, function: Callable[[], None]) -> None:
    if turn.failure:
        return
    try:
        function()
    except WorkerError as error:
        turn.failure = str(error)


def _first_call(
    turn: _EntryRuns, installations: Installations, folder: Path, measurement: MeasurementSettings
) -> None:
    """Measure the first call, then one in the worker, which gives the number of calls per sample."""
    library = turn.entry.library
    if library in installations.missing:
        raise WorkerError(installations.missing[library])
    prepare = {"call": turn.call, "function": turn.entry.function, "folder": str(folder)}
    with Worker(installations.pythons[library], library, timed_environment()) as fresh:
        fresh.ask("prepare", **prepare)
        reply = fresh.ask("run", call=turn.call, repeats=1)
    names = ("cpu", "wall", "result", "peak_mb", "grown_mb")
    turn.first = FirstCall(*(reply[name] for name in names))
    installations.workers[library].ask("prepare", **prepare)
    warm = installations.workers[library].ask("run", call=turn.call, repeats=1)
    turn.repeats = max(1, min(1000, math.ceil(measurement.sample / max(warm["call_cpu"], 1e-6))))


def _measure_round(turn: _EntryRuns, installations: Installations) -> None:
    reply = installations.workers[turn.entry.library].ask("run", call=turn.call, repeats=turn.repeats)
    turn.replies.append(reply)


def _result(turn: _EntryRuns) -> Result:
    if turn.failure:
        return Result(turn.entry, failure=turn.failure)
    cpu, wall = ([reply[name] for reply in turn.replies] for name in ("cpu", "wall"))
    last = turn.replies[-1]
    return Result(
        turn.entry,
        sample_statistics(cpu),
        sample_statistics(wall),
        turn.first,
        last["answer"],
        last["begin"],
        last["remark"],
    )


def measure_imports(
    installations: Installations, measurement: MeasurementSettings, report: Report
) -> dict[str, SampleStatistics]:
    """Measure the wall time of importing each library in fresh processes, which take turns."""
    modules = {
        name: LIBRARIES[name].module for name in installations.pythons if name not in installations.missing
    }
    samples: dict[str, list[float]] = {name: [] for name in modules}
    for name, module in modules.items():  # warm-up: bytecode and file cache
        _import_seconds(installations.pythons[name], module)
    for number in range(measurement.import_rounds):
        report(f"import: round {number + 1} of {measurement.import_rounds}")
        for name, module in modules.items():
            samples[name].append(_import_seconds(installations.pythons[name], module))
    return {name: sample_statistics(case_results) for name, case_results in samples.items()}


def _import_seconds(python: Path, module: str) -> float:
    program = f"from time import perf_counter as now; t = now(); import {module}; print(now() - t)"
    command = [str(python), "-W", "ignore", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, env=timed_environment(), check=False)
    return float(done.stdout.split()[-1]) if done.returncode == 0 else math.nan
