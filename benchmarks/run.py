"""Time pilotfish beside its peers, on the same data, in one run in which they take turns.

`python benchmarks/run.py` installs the peers of peers.txt, peers-jax.txt and so on into build/peers-venv,
build/peers-jax-venv and so on when they are missing, measures, prints the tables and writes them to
docs/benchmarks.md. Progress is told on stderr. A run of a part (--quick, --only, --cases) writes no
file unless --out names one.
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

from cases import CASES, LIBRARIES, OURS
from kinds import Case
from machine import load, machine
from measure import FULL, QUICK, Effort, Floor, measure, measure_imports
from peer_environment import execute, peer_environment, place_of
from report import Report, as_json, markdown
from workers import Worker, WorkerError, surroundings

HERE = Path(__file__).parent
DOCUMENT = HERE.parent / "docs" / "benchmarks.md"


def main() -> None:
    asked = arguments()
    report = benchmark(asked)
    text = markdown(report)
    print(text)
    whole = not (asked.quick or asked.only or asked.cases)
    out = asked.out or (DOCUMENT if whole else None)
    if out:
        out.write_text(text, encoding="utf-8")
    if asked.json:
        asked.json.write_text(json.dumps(as_json(report), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few repetitions: does everything work?")
    parser.add_argument("--rounds", type=int, help=f"turns that each library has (default {FULL.rounds})")
    parser.add_argument("--only", nargs="+", choices=LIBRARIES, help="these libraries (default: all)")
    parser.add_argument(
        "--cases", nargs="+", choices=[case.name for case in CASES], help="these cases (default: all)"
    )
    parser.add_argument(
        "--out", type=Path, help="file for the tables (default docs/benchmarks.md, for a whole run)"
    )
    parser.add_argument("--json", type=Path, help="file for all figures, samples too")
    return parser.parse_args()


def command_of(asked: argparse.Namespace) -> str:
    """The command as a reader would repeat it, without the files it wrote."""
    words = ["python benchmarks/run.py"]
    words += ["--quick"] if asked.quick else []
    words += [f"--rounds {asked.rounds}"] if asked.rounds else []
    words += [f"--only {' '.join(asked.only)}"] if asked.only else []
    words += [f"--cases {' '.join(asked.cases)}"] if asked.cases else []
    return " ".join(words)


def say(words: str) -> None:
    print(words, file=sys.stderr, flush=True)


def effort_of(asked: argparse.Namespace) -> Effort:
    effort = QUICK if asked.quick else FULL
    imports = min(effort.import_rounds, asked.rounds or effort.import_rounds)
    return replace(effort, rounds=asked.rounds or effort.rounds, import_rounds=imports)


def benchmark(asked: argparse.Namespace) -> Report:
    effort, before = effort_of(asked), load()
    cases = chosen(asked)
    pythons, missing = places([name for name in asked.only or LIBRARIES if takes_part(name, cases)])
    with tempfile.TemporaryDirectory(prefix="benchmarks-") as scratch, ExitStack() as stack:
        problems = Path(scratch)
        valve = make_problems(problems, effort)
        workers = {
            name: stack.enter_context(Worker(python, name, surroundings()))
            for name, python in pythons.items()
            if name not in missing
        }
        introductions = introduce(workers, missing)
        floor = Floor(pythons, workers, missing)
        taken = [
            (case, measure(case, floor, problems, effort, say)) for case in cases if shared(case, pythons)
        ]
        imports = measure_imports(floor, effort, say)
    now = datetime.now(UTC).strftime("%Y-%m-%d")
    return Report(
        command_of(asked),
        now,
        asked.quick,
        effort,
        machine(),
        (before, load()),
        valve,
        introductions,
        missing,
        taken,
        imports,
    )


def chosen(asked: argparse.Namespace) -> list[Case]:
    """The cases that are asked for; a quick run leaves the lengthy out, unless they are named."""
    if asked.cases:
        return [case for case in CASES if case.name in asked.cases]
    return [case for case in CASES if not (asked.quick and case.lengthy)]


def places(libraries: list[str]) -> tuple[dict[str, Path], dict[str, str]]:
    """The python that each library runs in, and why some cannot."""
    pythons: dict[str, Path] = {}
    missing: dict[str, str] = {}
    for environment in {LIBRARIES[name].environment: None for name in libraries}:
        names = [name for name in libraries if LIBRARIES[name].environment == environment]
        if not environment:
            pythons |= dict.fromkeys(names, Path(sys.executable))
            continue
        say(f"{environment}: looking after it")
        python, failures = peer_environment(*place_of(environment), execute)
        for requirement, reason in failures.items():  # told here only: it may name this machine
            say(f"{environment}: {requirement}: {reason}")
        reason = "it could not be installed; the run tells why on stderr"
        missing |= {name: reason for name in names if LIBRARIES[name].distribution in failures}
        pythons |= dict.fromkeys(names, python)
    return pythons, missing


def make_problems(folder: Path, effort: Effort) -> str:
    sizes = [f"{size}={count}" for size, count in (effort.iterations | effort.datapoints).items()]
    command = [sys.executable, str(HERE / "make_problems.py"), str(folder), *sizes]
    made = subprocess.run(command, env=surroundings(), stdout=subprocess.PIPE, text=True, check=True)
    return made.stdout.split()[-1]


def introduce(workers: dict[str, Worker], missing: dict[str, str]) -> dict[str, dict[str, str]]:
    """What each library says of itself; one that cannot even be imported joins the missing."""
    introductions = {}
    for name, worker in workers.items():
        try:
            introductions[name] = worker.ask("introduce")
        except WorkerError as error:
            if name == OURS:
                raise
            missing[name] = str(error)
    return introductions


def takes_part(library: str, cases: list[Case]) -> bool:
    return any(entry.library == library for case in cases for entry in case.entries)


def shared(case: Case, pythons: dict[str, Path]) -> bool:
    return any(entry.library in pythons for entry in case.entries)


if __name__ == "__main__":
    main()
