"""Kill every command that writes, fill its disk, and send it signals, at each system call of its writing.

    python tests/shared/fault_sweep.py --markdown docs/robustness.md     # the table of all commands
    python tests/shared/fault_sweep.py learn export                      # some of them, as JSON

The library faults.c is preloaded: it counts the calls that act on the output folder, and kills the process
or fails at the n-th. One process imports pilotfish and computes what a command writes; for each moment a
child of it runs the command line, from its main function on, in a folder made anew.
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
    """What one run with one fault left."""

    command: str
    replaces: bool
    fault: str
    number: int
    call: str
    code: int
    outputs: dict[str, str]  # missing, old, new, or what else
    extra_files: list[str]  # other names in the folder
    traceback: bool
    again: int = 0  # exit code of the same command afterwards, without a fault

    @property
    def faulty(self) -> str:
        """What is wrong with it; nothing, when it is as it must be."""
        fine = {"old", "new"} if self.replaces else {"missing", "new"}
        if bad := {name: was for name, was in self.outputs.items() if was not in fine}:
            return f"{bad}"
        hidden = all(name.startswith(".pilotfish-") for name in self.extra_files)
        if self.extra_files and not (self.fault == "killed" and hidden):
            return f"left behind: {self.extra_files}"
        if self.traceback:
            return "a traceback"
        if self.again:
            return f"exit code {self.again} at the next run"
        if self.fault.startswith("SIG") and self.code != 128 + FAULTS[self.fault][1]:
            return f"exit code {self.code}"
        if "new" not in self.outputs.values() and self.code == 0:
            return "exit code 0 without any output"
        return ""


def build_fault_library(folder: Path) -> Path | None:
    """The preloaded library, compiled; None where there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    library = folder / f"faults{sysconfig.get_config_var('SHLIB_SUFFIX')}"
    command = [compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(HERE / "faults.c"), "-ldl"]
    subprocess.run(command, check=True)
    return library


def sweep(chosen: list[str], faults: Sequence[str], folder: Path, *, brief: bool = False) -> list[Outcome]:
    """Run the commands of those names with those faults at every call.    Raises: RuntimeError.

    Brief is for outputs that replace others, at calls that differ, without the run afterwards.
    """
    if (library := build_fault_library(folder)) is None:
        raise RuntimeError("no C compiler was found; install gcc")
    environment = {**os.environ, "LD_PRELOAD": str(library), "OPENBLAS_NUM_THREADS": "1"}
    if find_library("OSMesa"):  # it draws without a screen
        environment.setdefault("MUJOCO_GL", "osmesa")
    command = [sys.executable, "-W", "ignore", __file__, *chosen, "--inside", str(folder)]
    command += ["--faults", *faults, *(["--brief"] if brief else [])]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if result.returncode:
        raise RuntimeError(result.stderr[-2000:])
    return [Outcome(**row) for row in json.loads(result.stdout)]


# ------------------------------------------------------------------------------- in the preloaded process


class SweepWorker:
    """The process that the library is preloaded in: inputs, and a run for each moment."""

    def __init__(self, work: Path, brief: bool) -> None:
        self.work, self.target, self.brief = work, work / "target", brief
        self.library = ctypes.CDLL(None)
        self.library.fault_calls.restype = ctypes.c_char_p

    def sweep(self, command: Command, faults: Sequence[str]) -> Iterator[Outcome]:
        """Every fault at every call that the command makes without a fault."""
        before, after = self.contents(command)
        calls = before.calls
        for fault in faults:
            for number in select_calls(calls, self.brief):
                yield self.outcome(command, before, after, (fault, number, calls[number - 1]))

    def contents(self, command: Command) -> "tuple[Contents, Contents]":
        """What the folder holds before the command, and after it, without a fault."""
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
        extra_files = {name for name in extra_files if name not in printed}  # as the message says
        again = self.again(command, after) if fault == "killed" and not self.brief else 0
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
            again,
        )

    def again(self, command: Command, after: "Contents") -> int:
        """The same command once more, in the folder as it is, with --force: its exit code, 1 if not new."""
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
        """Run the command line in a child, with the fault at that call; its exit code and what it printed."""
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
    """A copy of the output folder."""

    folder: Path
    calls: list[str] = field(default_factory=list)


def select_calls(calls: list[str], brief: bool) -> list[int]:
    """The number of each call, from 1, but of a run of equal calls only the first two and the last.

    Brief takes the first two and the last of all calls that are alike but for the name of a recording.
    """
    if brief:
        alike = [re.sub(r"[0-9]+-[a-z0-9-]+", "*", call) for call in calls]
        return [n + 1 for n, c in enumerate(alike) if alike[:n].count(c) < 2 or c not in alike[n + 1 :]]
    return [
        n + 1
        for n, call in enumerate(calls)
        if calls[max(n - 2, 0) : n] != [call, call] or calls[n + 1 : n + 2] != [call]
    ]


def copy_folder(folder: Path, place: Path) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(folder, place, symlinks=True)
    return place


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
    """The table command x moment x outcome; calls that follow one another and end alike share a row."""
    head = "| command | before | fault | at the calls | exit code | outputs | beside them |"
    lines = [HEAD, head, "|-" * 7 + "|"]
    for alike, rows in groupby(outcomes, cells):
        first, *others = rows
        calls = f"{first.number} {first.call}"
        if others:
            calls += f" ... {others[-1].number} {others[-1].call}"
        command, before, fault, *rest = alike
        lines.append("| " + " | ".join([command, before, fault, calls, *rest]) + " |")
    return "\n".join([*lines, ""])


def cells(outcome: Outcome) -> tuple[str, ...]:
    """What a row says, but for the calls."""
    hidden = ", ".join(sorted({re.sub(r"[0-9a-f]{16}", "*", name) for name in outcome.extra_files}))
    states = "; ".join(f"{name} {was}" for name, was in outcome.outputs.items())
    return (
        outcome.command,
        "other content" if outcome.replaces else "nothing",
        outcome.fault,
        "killed" if outcome.code < 0 else str(outcome.code),
        states,
        f"{hidden or 'nothing'}{outcome.faulty and f' (WRONG: {outcome.faulty})'}",
    )


HEAD = """# Killed processes and full disks

Every command that writes is run with a fault at each system call of its writing: the process is killed (a
write has written half its bytes by then), the disk is full from there on, one call fails with an input/output
error, or a signal arrives. Each output must then be the old one or the new one, whole. Only a killed process
may leave a hidden file or folder (`.pilotfish-*`), which nothing reads, and the same command with `--force`
must then succeed.

Made by `python tests/shared/fault_sweep.py --brief --markdown docs/robustness.md`: outputs that replace
others, and of calls that differ only in the name of a recording the first two and the last; without `--brief`
also outputs that replace nothing, and every call. `tests/files/test_faults.py` runs the same faults. In a
row, calls that follow one another and end alike stand together.
"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--faults", nargs="+", choices=FAULTS, default=list(FAULTS))
    parser.add_argument("--brief", action="store_true")
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("names", nargs="*")
    asked = parser.parse_args()
    if asked.inside:
        json.dump([asdict(outcome) for outcome in run_sweep(asked)], sys.stdout)
        return
    with tempfile.TemporaryDirectory() as folder:
        outcomes = sweep(asked.names, asked.faults, Path(folder), brief=asked.brief)
    if asked.markdown:
        asked.markdown.write_text(markdown(outcomes), encoding="utf-8")
    faulty = [outcome for outcome in outcomes if outcome.faulty]
    for outcome in faulty:
        sys.stdout.write(f"{outcome}: {outcome.faulty}\n")
    sys.stdout.write(f"{len(outcomes)} runs, {len(faulty)} faulty\n")
    sys.exit(bool(faulty))


def run_sweep(asked: argparse.Namespace) -> Iterator[Outcome]:
    """All outcomes of the commands of those names, of all commands when there are none."""
    work, wanted = asked.inside, asked.names
    make_inputs(work / "inputs")
    there = commands(work / "inputs")
    chosen = [command for command in there if not wanted or command.name in wanted]
    run_once(chosen, work / "inputs")
    if "in place" in wanted:
        chosen.append(overwrite_command(work / "inputs"))
    inside = SweepWorker(work, asked.brief)
    for command in chosen:
        if command.old or not asked.brief:
            yield from inside.sweep(command, asked.faults)


if __name__ == "__main__":
    main()
