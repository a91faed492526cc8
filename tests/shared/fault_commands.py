"""The commands of the fault sweep, what they read, and what they compute once (fault_sweep.py)."""

import contextlib
import signal
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from errno import EIO, ENOSPC
from pathlib import Path
from typing import Any

KILL, FAIL, FULL, SIGNAL = 1, 2, 3, 4  # as in faults.c
FAULTS = {
    "killed": (KILL, 0),
    "disk full": (FULL, ENOSPC),
    "input/output error": (FAIL, EIO),
    "SIGINT": (SIGNAL, int(signal.SIGINT)),
    "SIGTERM": (SIGNAL, int(signal.SIGTERM)),
    "SIGHUP": (SIGNAL, int(signal.SIGHUP)),
}


@dataclass(frozen=True)
class Command:
    """A command line whose outputs are in the folder where it runs."""

    name: str
    line: list[str]
    outputs: list[str]  # files and folders
    old: bool  # whether the outputs are there before, with other content


def commands(inputs: Path) -> list[Command]:
    """Every command that writes, with its outputs missing before, and with others there and --force."""
    recordings, skill, rows = (str(inputs / name) for name in ("recordings", "a.skill", "rows"))
    stream = ["stream", rows, "--learner", "dp-gmm", "--cluster", "0.1", "--noise", "1e-3"]
    select = ["select", recordings, "--states", "2", "--structures", "full", "--iterations", "2"]
    via = ["--via", "position=0.5,0.5@1s+-0.01", "--via-picture", "via.png"]
    lines = {
        "learn": (["learn", recordings, "--states", "2", "--out", "new.skill"], ["new.skill"]),
        "stream": ([*stream, "--out", "a.stream", "--skill", "b.skill"], ["a.stream", "b.skill"]),
        "select": ([*select, "--out", "sizes.png"], ["sizes.png"]),
        "replay": (["replay", skill, "--out", "m.csv", "--gains", "g.npz"], ["m.csv", "g.npz"]),
        "replay pictures": (["replay", skill, "--picture", "p.png", *via], ["p.png", "via.png"]),
        "show": (["show", skill, "--pictures", "."], ["deviations.png", "occupancy.png", "states.png"]),
        "data export": (["data", "export", "synthetic valve", "set"], ["set"]),
        "record": (["record", "valve", "--demonstrations", "2", "--out", "set"], ["set"]),
        "perform": (
            [
                "perform",
                str(inputs / "valve.skill"),
                "--task",
                "valve",
                "--situations",
                "1",
                "--film",
                "f.webp",
            ],
            ["f.webp"],
        ),
        "demo": (["demo", "--out", "."], ["valve.skill", "report.html"]),
    }
    return [
        Command(name, [*line, "--force"] if old and name != "demo" else line, outputs, old)
        for name, (line, outputs) in lines.items()
        for old in (False, True)
    ]


def in_place(inputs: Path) -> Command:
    """A command that opens its output to write, as none of pilotfish does: replay, its precautions off."""
    from pilotfish.station import commands_replay

    @contextlib.contextmanager
    def careless(path: Path, **_: Any) -> Iterator[Path]:
        yield path

    commands_replay.whole_file = careless
    return Command(
        "in place", ["replay", str(inputs / "a.skill"), "--out", "m.csv", "--force"], ["m.csv"], True
    )


def make_old(command: Command, path: Path) -> None:
    """Another output of the same kind."""
    if path.name != "set":
        path.write_bytes(b"the old content")
        return
    import numpy as np

    from pilotfish.demonstrations import demonstration, position_layout, write_folder

    x = np.random.default_rng(1).normal(size=(5, 2))
    write_folder([demonstration(x, 0.1, position_layout(2), (), "old")], path)


def make_inputs(inputs: Path) -> None:
    """Two short recordings, a skill of two states, rows of numbers."""
    import numpy as np

    from pilotfish.demonstrations import demonstration, position_layout, with_derivatives, write_folder
    from pilotfish.models import learn
    from pilotfish.store import save_skill

    inputs.mkdir()
    rng, time = np.random.default_rng(0), np.linspace(0.0, 1.0, 30)
    arcs = [np.column_stack([time, np.sin(3.0 * time)]) + rng.normal(0.0, 0.01, (30, 2)) for _ in range(3)]
    demos = [demonstration(x, 0.1, position_layout(2), (), f"arc {m}") for m, x in enumerate(arcs)]
    write_folder(demos, inputs / "recordings")
    save_skill(learn([with_derivatives(d) for d in demos], states=2, rng=rng).skill, inputs / "a.skill")
    np.savetxt(inputs / "rows", np.vstack(arcs))


KEPT: "list[Kept]" = []


class Kept:
    """A function whose results are computed once, and then given again in the order of the calls.

    It stands for what takes long, physics and learning; writing is never kept.
    """

    def __init__(self, module: Any, name: str) -> None:
        self.real, self.results, self.calls = getattr(module, name), [], 0
        KEPT.append(self)
        setattr(module, name, self)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        if self.calls == len(self.results):
            self.results.append(self.result(*arguments, **options))
        self.calls += 1
        return self.given(self.results[self.calls - 1], **options)

    def result(self, *arguments: Any, **options: Any) -> Any:
        return self.real(*arguments, **options)

    def given(self, result: Any, **_: Any) -> Any:
        return result


class KeptRecordings(Kept):
    """recorder.shown, a generator."""

    def result(self, *arguments: Any, **options: Any) -> Any:
        return list(self.real(*arguments, **options))


class KeptExecution(Kept):
    """execution.execute, which a camera films."""

    def result(self, *arguments: Any, **options: Any) -> Any:
        made, watch = self.real(*arguments, **options), options["watch"]
        watch.close()
        return made, watch.frames, watch.times

    def given(self, result: Any, **options: Any) -> Any:
        made, options["watch"].frames, options["watch"].times = result
        return made


def compute_once(chosen: list[Command], inputs: Path) -> None:
    """Run each command once, here, so that every child has its imports and what takes long."""
    from pilotfish.station import pictures

    pictures.DOTS_PER_INCH = 20  # small pictures, drawn quickly
    lines = {command.name: command.line for command in chosen if not command.old}
    if {"record", "perform"} & set(lines):
        from pilotfish.station import recorder

        KeptRecordings(recorder, "shown")
        record = ["record", "valve", "--demonstrations", "2", "--out", str(inputs / "valve")]
        run_here(record)
        run_here(["learn", str(inputs / "valve"), "--states", "4", "--out", str(inputs / "valve.skill")])
    for name, line in lines.items():
        keep_long_parts(name)
        run_here(line)


def keep_long_parts(name: str) -> None:
    """Keep what a command computes for long."""
    if name == "select":
        from pilotfish.station import commands_select

        Kept(commands_select, "_scored")
    if name == "perform":
        from pilotfish.station import execution

        KeptExecution(execution, "execute")
    if name == "demo":
        from pilotfish.station import demo, report

        Kept(demo, "_lesson")
        Kept(demo, "_in_physics")
        Kept(report, "page")


def run_here(line: list[str]) -> None:
    """Run a command line in this process, in a folder that is removed afterwards."""
    from click.testing import CliRunner

    from pilotfish.station.command_line import cli

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        CliRunner().invoke(cli, line, prog_name="pilotfish", catch_exceptions=False)
    for function in KEPT:
        function.calls = 0
