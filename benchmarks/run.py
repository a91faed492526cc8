"""Measure pilotfish and its peers on the same data in one run.

`python benchmarks/run.py` installs the missing peers of peers.txt, peers-jax.txt and so on into
build/peers-venv, build/peers-jax-venv and so on. It measures, prints the tables and writes them to
docs/benchmarks.md. Progress is printed on stderr. A partial run (--quick, --only, --cases) writes no file
unless --out names one.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from cases import CASES
from kinds import Case
from machine import load, machine
from measure import FULL, QUICK, Installations, MeasurementSettings, measure, measure_imports
from peer_environment import environment_folder, execute, peer_environment
from peer_libraries import LIBRARIES, OURS
from report import Report, as_json, markdown
from workers import Worker, WorkerError, timed_environment

HERE = Path(__file__).parent
DOCUMENT = HERE.parent / "docs" / "benchmarks.md"


def main() -> None:
    options = arguments()
    report = benchmark(options)
    text = markdown(report)
    print(text)
    whole = not (options.quick or options.only or options.cases)
    out = options.out or (DOCUMENT if whole else None)
    if out:
        out.write_text(text, encoding="utf-8")
    if options.json:
        options.json.write_text(
            json.dumps(as_json(report), indent=1, allow_nan=False) + "\n", encoding="utf-8"
        )


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few repetitions, to test that everything works")
    parser.add_argument("--rounds", type=int, help=f"number of rounds (default {FULL.rounds})")
    parser.add_argument("--only", nargs="+", choices=LIBRARIES, help="these libraries (default: all)")
    parser.add_argument(
        "--cases", nargs="+", choices=[case.name for case in CASES], help="these cases (default: all)"
    )
    parser.add_argument(
        "--out", type=Path, help="file for the tables (default docs/benchmarks.md, for a whole run)"
    )
    parser.add_argument("--json", type=Path, help="file for all figures, samples included")
    return parser.parse_args()


def format_command(options: argparse.Namespace) -> str:
    """Return the command that repeats the run, without output files."""
    words = ["python benchmarks/run.py"]
    words += ["--quick"] if options.quick else []
    words += [f"--rounds {options.rounds}"] if options.rounds else []
    words += [f"--only {' '.join(options.only)}"] if options.only else []
    words += [f"--cases {' '.join(options.cases)}"] if options.cases else []
    return " ".join(words)


def report_progress(text: str) -> None:
    """Print progress on stderr."""
    print(text, file=sys.stderr, flush=True)


def measurement_settings(options: argparse.Namespace) -> MeasurementSettings:
    measurement = QUICK if options.quick else FULL
    imports = min(measurement.import_rounds, options.rounds or measurement.import_rounds)
    return replace(measurement, rounds=options.rounds or measurement.rounds, import_rounds=imports)


def benchmark(options: argparse.Namespace) -> Report:
    measurement, before = measurement_settings(options), load()
    cases = select_cases(options)
    pythons, missing = library_pythons([name for name in options.only or LIBRARIES if is_needed(name, cases)])
    with tempfile.TemporaryDirectory(prefix="benchmarks-") as folder, ExitStack() as stack:
        problems = Path(folder)
        valve = make_problems(problems, measurement)
        workers = {
            name: stack.enter_context(Worker(python, name, timed_environment()))
            for name, python in pythons.items()
            if name not in missing
        }
        introductions = introduce(workers, missing)
        installations = Installations(pythons, workers, missing)
        case_results = [
            (case, measure(case, installations, problems, measurement, report_progress))
            for case in cases
            if has_entries(case, pythons)
        ]
        imports = measure_imports(installations, measurement, report_progress)
    now = datetime.now(UTC).strftime("%Y-%m-%d")
    return Report(
        format_command(options),
        now,
        options.quick,
        measurement,
        machine(),
        (before, load()),
        valve,
        introductions,
        missing,
        case_results,
        imports,
    )


def select_cases(options: argparse.Namespace) -> list[Case]:
    """Return the requested cases; a quick run omits lengthy ones unless they are named."""
    if options.cases:
        return [case for case in CASES if case.name in options.cases]
    return [case for case in CASES if not (options.quick and case.lengthy)]


def library_pythons(libraries: list[str]) -> tuple[dict[str, Path], dict[str, str]]:
    """Return the Python of each library, and the reasons for the missing ones."""
    pythons: dict[str, Path] = {}
    missing: dict[str, str] = {}
    for environment in {LIBRARIES[name].environment: None for name in libraries}:
        names = [name for name in libraries if LIBRARIES[name].environment == environment]
        if not environment:
            pythons |= dict.fromkeys(names, Path(sys.executable))
            continue
        report_progress(f"{environment}: checking the installation")
        python, failures = peer_environment(*environment_folder(environment), execute)
        for requirement, reason in failures.items():  # on stderr only: it may name this machine
            report_progress(f"{environment}: {requirement}: {reason}")
        reason = "it could not be installed; the run printed why on stderr"
        missing |= {name: reason for name in names if LIBRARIES[name].distribution in failures}
        pythons |= dict.fromkeys(names, python)
    return pythons, missing


def make_problems(folder: Path, measurement: MeasurementSettings) -> str:
    sizes = [f"{size}={count}" for size, count in (measurement.iterations | measurement.datapoints).items()]
    command = [sys.executable, str(HERE / "make_problems.py"), str(folder), *sizes]
    made = subprocess.run(command, env=timed_environment(), stdout=subprocess.PIPE, text=True, check=True)
    return made.stdout.split()[-1]


def introduce(workers: dict[str, Worker], missing: dict[str, str]) -> dict[str, dict[str, str]]:
    """Return versions and remarks of each library; one that cannot be imported becomes missing."""
    introductions = {}
    for name, worker in workers.items():
        try:
            introductions[name] = worker.ask("introduce")
        except WorkerError as error:
            if name == OURS:
                raise
            missing[name] = str(error)
    return introductions


def is_needed(library: str, cases: list[Case]) -> bool:
    """Return whether a library takes part in a case."""
    return any(entry.library == library for case in cases for entry in case.entries)


def has_entries(case: Case, pythons: dict[str, Path]) -> bool:
    """Return whether a library of the case is available."""
    return any(entry.library in pythons for entry in case.entries)


if __name__ == "__main__":
    main()
