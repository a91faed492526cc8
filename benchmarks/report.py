"""Results of a benchmark run as a value, as Markdown and as JSON."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from judging import agrees, disagreement, own_result, requirement_results
from kinds import Case
from machine import Machine
from measure import MeasurementSettings, Result, SampleStatistics
from peer_libraries import LIBRARIES, NOT_INSTALLABLE
from requirements import format_milliseconds, format_rate, ratio

VALVE_PROBLEMS = ("valve", "frames", "tracking", "semi_markov_valve")


@dataclass(frozen=True, slots=True)
class Report:
    """One run of the benchmarks; introductions hold the versions and remarks of each library."""

    command: str
    date: str
    quick: bool
    measurement: MeasurementSettings
    machine: Machine
    loads: tuple[float, float]  # before and after
    valve: str  # real or synthetic
    introductions: dict[str, dict[str, str]]
    missing: dict[str, str]
    cases: list[tuple[Case, list[Result]]]
    imports: dict[str, SampleStatistics]


# -------------------------------------------------------------------------------- Markdown


def markdown(report: Report) -> str:
    parts = (_head, _requirements, _times, _streams, _notes, _foot)
    return "\n".join(line for part in parts for line in part(report)) + "\n"


def _head(report: Report) -> Iterator[str]:
    yield "# Benchmarks"
    yield ""
    yield (
        f"Written on {report.date} by `{report.command}`. Libraries run on the same data, each in its own "
        f"process with one thread. They take turns (A B C A B C ...) for {report.measurement.rounds} rounds, "
        f"fewer if a case takes longer than {report.measurement.time_limit:g} s. Times are CPU milliseconds. "
        "A ratio is the CPU time relative to pilotfish's first row, the median over rounds."
    )
    if report.quick:
        yield ""
        yield "**A quick run, to test that everything works. Do not quote its figures.**"
    if report.valve == "synthetic" and any(case.problem in VALVE_PROBLEMS for case, _ in report.cases):
        yield ""
        yield ("**The valve data is synthetic**, of the recording's size: `PILOTFISH_DATA` was not set.")


def _requirements(report: Report) -> Iterator[str]:
    yield from ("", "## Targets", "")
    rows = [(v.requirement, v.measured, v.verdict) for v in requirement_results(report.cases)]
    yield from table(("target", "measured", "verdict"), rows, "llr")


def _times(report: Report) -> Iterator[str]:
    yield from ("", "## Times", "")
    titles = (
        "case",
        "library",
        "CPU ms",
        "min",
        "quartiles",
        "wall ms",
        "first result s",
        "peak MB",
        "grown MB",
        "ratio",
        "answer",
    )
    rows = [row for case, results in report.cases if not case.unit for row in _rows(case, results)]
    if rows:
        yield from table(titles, rows, "llrrrrrrrrl")
    yield ""
    yield (
        "CPU, minimum, quartiles and wall: calls in a long-lived process. First result: CPU seconds of a "
        "fresh process until its first answer, with import, compilation, reading of the data and the "
        "iterations of one call. Peak memory (resident), and its growth by that call: the same process."
    )
    for failed in (r for _, results in report.cases for r in results if r.failure):
        yield from ("", f"{failed.entry.label} failed: {failed.failure}")


def _rows(case: Case, results: Sequence[Result]) -> Iterator[tuple[str, ...]]:
    own = own_result(results)
    for number, result in enumerate(results):
        name = f"`{case.name}`" if number == 0 else ""
        if not (result.cpu and result.wall and result.first):
            yield (name, result.entry.label, *[""] * 8, "failed")
            continue
        times_ours = f"{ratio(result.cpu, own.cpu):.2f}" if own and own.cpu else ""
        quartiles = f"{format_milliseconds(result.cpu.lower)} - {format_milliseconds(result.cpu.upper)}"
        times = (format_milliseconds(result.cpu.median), format_milliseconds(result.cpu.minimum), quartiles)
        first = (f"{result.first.result:.2f}", f"{result.first.peak_mb:.0f}", f"{result.first.grown_mb:.0f}")
        remarks = "; ".join(filter(None, (result.remark, result.entry.differs)))
        answer = f"{result.answer:.10g}" + (f" ({remarks})" if remarks else "")
        wall = format_milliseconds(result.wall.median)
        yield (name, result.entry.label, *times, wall, *first, times_ours, answer)


def _streams(report: Report) -> Iterator[str]:
    streams = [(case, results) for case, results in report.cases if case.unit]
    if not streams:
        return
    yield from ("", "## Streams", "")
    titles = (
        "case",
        "library",
        "NMI",
        "datapoints per CPU second",
        "CPU us each",
        "quartiles",
        "grown MB",
        "peak MB",
        "ratio",
        "remarks",
    )
    yield from table(titles, [row for stream in streams for row in _stream_rows(*stream)], "llrrrrrrrl")
    yield ""
    yield (
        "CPU: time per datapoint of calls in a long-lived process that learn a whole stream, without tuning "
        "and prediction of labels. NMI: normalised mutual information of found and true clusters, divided by "
        "the mean entropy, by the same code for all. Grown and peak memory: a fresh process, as above."
    )


def _stream_rows(case: Case, results: Sequence[Result]) -> Iterator[tuple[str, ...]]:
    own = own_result(results)
    for number, result in enumerate(results):
        name = f"`{case.name}`" if number == 0 else ""
        if not (result.cpu and result.first):
            yield (name, result.entry.label, *[""] * 7, "failed")
            continue
        each = result.cpu
        took = [format_milliseconds(s * 1e3) for s in (each.median, each.lower, each.upper)]
        times_ours = f"{ratio(each, own.cpu):.1f}" if own and own.cpu else ""
        memory = (f"{result.first.grown_mb:.1f}", f"{result.first.peak_mb:.0f}")
        speed = (format_rate(each.median), took[0], f"{took[1]} - {took[2]}")
        found = f"{result.answer:.3f}"
        yield (name, result.entry.label, found, *speed, *memory, times_ours, result.remark)


def _notes(report: Report) -> Iterator[str]:
    yield from ("", "## Cases", "")
    for case, results in report.cases:
        explanation = case.explanation
        for size, count in (report.measurement.iterations | report.measurement.datapoints).items():
            explanation = explanation.replace(f"{{{size}}}", str(count))
        answer = f"Answer: {case.answer}{_agreement(case, results)}."
        yield f"- `{case.name}`: {case.title}. {explanation} {answer}"


def _agreement(case: Case, results: Sequence[Result]) -> str:
    measured = [result for result in results if not result.failure]
    if case.agreement is None or len(measured) < 2:
        return ""
    difference = disagreement(results)
    if agrees(case, results):
        differs = any(result.entry.differs for result in measured)
        agreement = "the initial answers agree" if differs else "the answers agree"
        return f"; {agreement} within a relative {max(difference, 1e-16):.0e}"
    return f"; **the answers differ by a relative {difference:.1e}, expected at most {case.agreement:.0e}**"


def _foot(report: Report) -> Iterator[str]:
    yield from ("", "## Libraries and machine", "")
    rows = []
    for name, introduction in report.introductions.items():
        case_results = report.imports.get(name)
        seconds = (
            f"{case_results.median:.3f} ({case_results.minimum:.3f})"
            if case_results and not math.isnan(case_results.median)
            else ""
        )
        library = LIBRARIES[name]
        about = library.description + (f"; {introduction['remark']}" if introduction["remark"] else "")
        rows.append((library.name, introduction["version"], f"`import {library.module}`", seconds, about))
    yield from table(("library", "version", "import", "s, median (min)", "what is timed"), rows, "lllrl")
    for name, reason in report.missing.items():
        yield from ("", f"{LIBRARIES[name].name} is not installed: {reason}")
    yield from ("", "Tried without success:", "")
    yield from (f"- {name}: {reason}." for name, reason in NOT_INSTALLABLE.items())
    machine, versions = (
        report.machine,
        next(iter(report.introductions.values()), {"python": "?", "numpy": "?"}),
    )
    yield ""
    yield (
        f"Imports: wall seconds in a fresh process, {report.measurement.import_rounds} for each library. "
        f"Machine: {machine.processor}, {machine.cores} cores, {machine.memory_gb:.0f} GB, {machine.system}; "
        f"Python {versions['python']}, NumPy {versions['numpy']}; "
        f"load {report.loads[0]:.1f} before and {report.loads[1]:.1f} after."
    )


def table(titles: Sequence[str], rows: Sequence[Sequence[str]], sides: str) -> Iterator[str]:
    yield f"| {' | '.join(titles)} |"
    yield f"| {' | '.join('---:' if side == 'r' else '---' for side in sides)} |"
    yield from (f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in rows)


# -------------------------------------------------------------------------------- JSON


def as_json(report: Report) -> dict[str, Any]:
    """Return everything as JSON, samples [s] included; NaN becomes null."""
    cases = [
        {
            "case": case.name,
            "title": case.title,
            "disagreement": disagreement(results) if case.agreement is not None else None,
            "entries": [asdict(result) for result in results],
        }
        for case, results in report.cases
    ]
    imports = {name: asdict(case_results) for name, case_results in report.imports.items()}
    rest = {
        name: getattr(report, name)
        for name in ("command", "date", "quick", "loads", "valve", "introductions", "missing")
    }
    requirements = [asdict(verdict) for verdict in requirement_results(report.cases)]
    settings = {"machine": asdict(report.machine), "measurement": asdict(report.measurement)}
    whole: dict[str, Any] = _without_nan(
        {**rest, **settings, "targets": requirements, "cases": cases, "imports": imports}
    )
    return whole


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
