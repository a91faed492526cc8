"""Inject faults into every command that writes: kill it, fill its disk or send signals, at each system call.

    python tests/shared/fault_sweep.py --brief --markdown docs/robustness.md    # table of all commands
    python tests/shared/fault_sweep.py learn "data export"                      # two of them

The library faults.c is preloaded: it counts the system calls on the output folder, and kills the process or
fails at the n-th call. One process imports pilotfish and computes what the commands write. For each fault, a
forked child runs the command line from its main function in a new folder.
"""

import argparse
import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator, Sequence
from ctypes.util import find_library
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path

from fault_commands import FAULTS, Command, commands, make_inputs, make_old, overwrite_command, run_once

NO_FAULT = "none"
HERE = Path(__file__).parent


@dataclass(frozen=True)
class Outcome:
    """Result of one run with one fault.

    Attributes:
        command: Name of the command.
        replaces: Whether old outputs existed.
        fault: Name of the fault.
        number: Number of the system call, from 1.
        call: The system call.
        code: Exit code; negative if killed.
        outputs: State of each output: missing, old, new, or neither old nor new.
        extra_files: Other names in the folder.
        traceback: Whether a traceback was printed.
        next_code: Exit code of the same command afterwards, without a fault.
    """

    command: str
    replaces: bool
    fault: str
    number: int
    call: str
    code: int
    outputs: dict[str, str]
    extra_files: list[str]
    traceback: bool
    next_code: int = 0

    @property
    def faulty(self) -> str:
        """What is wrong with the result; empty if nothing is."""
        valid = {"old", "new"} if self.replaces else {"missing", "new"}
        if bad := {name: was for name, was in self.outputs.items() if was not in valid}:
            return f"{bad}"
        hidden = all(name.startswith(".pilotfish-") for name in self.extra_files)
        if self.extra_files and not (self.fault == "killed" and hidden):
            return f"left behind: {self.extra_files}"
        if self.traceback:
            return "a traceback"
        if self.next_code:
            return f"exit code {self.next_code} at the next run"
        if self.fault.startswith("SIG") and self.code != 128 + FAULTS[self.fault][1]:
            return f"exit code {self.code}"
        if "new" not in self.outputs.values() and self.code == 0:
            return "exit code 0 without any output"
        return ""


def build_fault_library(folder: Path) -> Path | None:
    """Compile the library to preload; return None if there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    library = folder / f"faults{sysconfig.get_config_var('SHLIB_SUFFIX')}"
    command = [compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(HERE / "faults.c"), "-ldl"]
    subprocess.run(command, check=True)
    return library


def sweep(chosen: list[str], faults: Sequence[str], folder: Path, *, brief: bool = False) -> list[Outcome]:
    """Run commands with faults at every system call, in a process with the preloaded library.

    Args:
        chosen: Names of commands; empty for all.
        faults: Names of faults.
        folder: Empty folder for the library, inputs and outputs.
        brief: Whether to run only with old outputs, at calls that differ, and without a run afterwards.

    Raises:
        RuntimeError: If there is no compiler or the process fails.
    """
    if (library := build_fault_library(folder)) is None:
        raise RuntimeError("no C compiler was found; install gcc")
    environment = {**os.environ, "LD_PRELOAD": str(library), "OPENBLAS_NUM_THREADS": "1"}
    if find_library("OSMesa"):  # renders without a screen
        environment.setdefault("MUJOCO_GL", "osmesa")
    command = [sys.executable, "-W", "ignore", __file__, *chosen, "--inside", str(folder)]
    command += ["--faults", *faults, *(["--brief"] if brief else [])]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if result.returncode:
        raise RuntimeError(result.stderr[-2000:])
    return [Outcome(**row) for row in json.loads(result.stdout)]


# ------------------------------------------------------------------------------- in the preloaded process


class SweepWorker:
    """Runs of commands with faults, in the process with the preloaded library."""

    def __init__(self, work: Path, brief: bool) -> None:
        self.work, self.target, self.brief = work, work / "target", brief
        self.library = ctypes.CDLL(None)
        self.library.fault_calls.restype = ctypes.c_char_p

    def sweep(self, command: Command, faults: Sequence[str]) -> Iterator[Outcome]:
        """Yield the outcome of every fault at every call of the command."""
        before, after = self.contents(command)
        calls = before.calls
        for fault in faults:
            for number in select_calls(calls, self.brief):
                yield self.outcome(command, before, after, (fault, number, calls[number - 1]))

    def contents(self, command: Command) -> "tuple[Contents, Contents]":
        """Return the folder before and after the command without a fault."""
        self.fresh(None)
        if command.old:
            for name in command.outputs:
                make_old(command, self.target / name)
        before = Contents(copy_folder(self.target, self.work / "before"))
        code, printed = self.run(command, 0, NO_FAULT, before)
        assert code == 0, f"{command.line}: {code}, {printed}"
        before.calls = (self.work / "calls").read_text().splitlines()
        return before, Contents(copy_folder(self.target, self.work / "after"))

    def outcome(
        self, command: Command, before: "Contents", after: "Contents", moment: tuple[str, int, str]
    ) -> Outcome:
        fault, number, call = moment
        code, printed = self.run(command, number, fault, before)
        outputs = {name: state(name, self.target, before, after) for name in command.outputs}
        extra_files = names(self.target) - names(before.folder) - set(command.outputs)
        extra_files = {name for name in extra_files if name not in printed}  # unless the message names it
        next_code = self.run_again(command, after) if fault == "killed" and not self.brief else 0
        return Outcome(
            command.name,
            command.old,
            fault,
            number,
            call,
            code,
            outputs,
            sorted(extra_files),
            "Traceback" in printed,
            next_code,
        )

    def run_again(self, command: Command, after: "Contents") -> int:
        """Run the command once more with --force; return its exit code, or 1 if an output is not new."""
        line = command.line if command.name == "demo" else [*command.line, "--force"]
        code, _ = self.child(line, 0, NO_FAULT)
        states = {state(name, self.target, after, after) for name in command.outputs}
        return code or int(states != {"old"})

    def run(self, command: Command, number: int, fault: str, before: "Contents") -> tuple[int, str]:
        self.fresh(before.folder)
        return self.child(command.line, number, fault)

    def fresh(self, source: Path | None) -> None:
        shutil.rmtree(self.target, ignore_errors=True)
        if source is None:
            self.target.mkdir()
        else:
            shutil.copytree(source, self.target, symlinks=True)

    def child(self, line: list[str], number: int, fault: str) -> tuple[int, str]:
        """Run a command line in a child with a fault; return its exit code and output."""
        printed = self.work / "printed"
        if (child := os.fork()) == 0:
            self.in_child(line, number, fault, printed)
        _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status), printed.read_text(errors="replace")

    def in_child(self, line: list[str], number: int, fault: str, printed: Path) -> None:
        from pilotfish.cli import main

        descriptor = os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        sys.argv = ["pilotfish", *line]
        os.chdir(self.target)
        action, value = FAULTS.get(fault, (0, 0))
        self.library.fault_plan(os.fsencode(self.target), ctypes.c_long(number), action, value)
        code = 3
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            if fault == NO_FAULT:
                calls = re.sub(rb"\.pilotfish-[0-9a-f]+", b".pilotfish-*", self.library.fault_calls())
                (self.work / "calls").write_bytes(calls)
            os._exit(code)


@dataclass
class Contents:
    """Copy of the output folder, with the calls that led to it."""

    folder: Path
    calls: list[str] = field(default_factory=list)


def select_calls(calls: list[str], brief: bool) -> list[int]:
    """Return the numbers of the calls to test, from 1: of a run of equal calls the first two and the last.

    With brief, calls that differ only in the name of a recording count as equal, wherever they are.
    """
    if brief:
        alike = [re.sub(r"[0-9]+-[a-z0-9-]+", "*", call) for call in calls]
        return [n + 1 for n, c in enumerate(alike) if alike[:n].count(c) < 2 or c not in alike[n + 1 :]]
    return [
        n + 1
        for n, call in enumerate(calls)
        if calls[max(n - 2, 0) : n] != [call, call] or calls[n + 1 : n + 2] != [call]
    ]


def copy_folder(folder: Path, target: Path) -> Path:
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(folder, target, symlinks=True)
    return target


def state(name: str, folder: Path, before: Contents, after: Contents) -> str:
    now = content(folder / name)
    if now is None:
        return "missing"
    if now == content(before.folder / name):
        return "old"
    return "new" if now == content(after.folder / name) else "neither old nor new"


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def content(path: Path) -> dict[str, bytes] | bytes | None:
    if path.is_dir():
        return {file.name: file.read_bytes() for file in path.iterdir()}
    return path.read_bytes() if path.exists() else None


# ---------------------------------------------------------------------------------------------- the table


def markdown(outcomes: list[Outcome]) -> str:
    """Return the table of outcomes; consecutive calls with equal results share a row."""
    head = "| command | before | fault | calls | exit code | outputs | other files |"
    lines = [HEAD, head, "|-" * 7 + "|"]
    for equal_cells, rows in groupby(outcomes, cells):
        first, *others = rows
        calls = f"{first.number} {first.call}"
        if others:
            calls += f" ... {others[-1].number} {others[-1].call}"
        command, before, fault, *rest = equal_cells
        lines.append("| " + " | ".join([command, before, fault, calls, *rest]) + " |")
    return "\n".join([*lines, ""])


def cells(outcome: Outcome) -> tuple[str, ...]:
    """Return the cells of a row without the calls."""
    hidden = ", ".join(sorted({re.sub(r"[0-9a-f]{16}", "*", name) for name in outcome.extra_files}))
    states = "; ".join(f"{name} {was}" for name, was in outcome.outputs.items())
    return (
        outcome.command,
        "old outputs" if outcome.replaces else "no outputs",
        outcome.fault,
        "killed" if outcome.code < 0 else str(outcome.code),
        states,
        f"{hidden or 'none'}{outcome.faulty and f' (WRONG: {outcome.faulty})'}",
    )


HEAD = """# Killed processes and full disks

Every command that writes runs with a fault at each system call of its writing. The faults are:

- the process is killed; a write has written half of its bytes by then,
- the disk is full from that call on,
- one call fails with an input/output error,
- a signal arrives.

Afterwards each output must be the old one or the new one, complete. Only a killed process may leave a hidden
file or folder (`.pilotfish-*`), which nothing reads. The same command with `--force` must then succeed.

The table was written by `python tests/shared/fault_sweep.py --brief --markdown docs/robustness.md`. It has
outputs that replace old ones. Of calls that differ only in the name of a recording, it has the first two and
the last. Without `--brief` the sweep has every call, and outputs that replace nothing.
`tests/io/test_write_faults.py` runs the same faults. Consecutive calls with equal results share a row.
"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--faults", nargs="+", choices=FAULTS, default=list(FAULTS))
    parser.add_argument("--brief", action="store_true")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    if arguments.inside:
        json.dump([asdict(outcome) for outcome in run_sweep(arguments)], sys.stdout)
        return
    with tempfile.TemporaryDirectory() as folder:
        outcomes = sweep(arguments.names, arguments.faults, Path(folder), brief=arguments.brief)
    if arguments.markdown:
        arguments.markdown.write_text(markdown(outcomes), encoding="utf-8")
    faulty = [outcome for outcome in outcomes if outcome.faulty]
    for outcome in faulty:
        sys.stdout.write(f"{outcome}: {outcome.faulty}\n")
    sys.stdout.write(f"{len(outcomes)} runs, {len(faulty)} faulty\n")
    sys.exit(bool(faulty))


def run_sweep(arguments: argparse.Namespace) -> Iterator[Outcome]:
    """Yield the outcomes of the commands with the given names, or of all commands."""
    work, wanted = arguments.inside, arguments.names
    make_inputs(work / "inputs")
    known = commands(work / "inputs")
    chosen = [command for command in known if not wanted or command.name in wanted]
    run_once(chosen, work / "inputs")
    if "in place" in wanted:
        chosen.append(overwrite_command(work / "inputs"))
    worker = SweepWorker(work, arguments.brief)
    for command in chosen:
        if command.old or not arguments.brief:
            yield from worker.sweep(command, arguments.faults)


if __name__ == "__main__":
    main()
