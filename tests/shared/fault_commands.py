"""Commands of the fault sweep, their inputs, and the slow computations that are cached (fault_sweep.py)."""

import contextlib
import signal
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from errno import EIO, ENOSPC
from pathlib import Path
from typing import Any

KILL, FAIL, FULL, SIGNAL = 1, 2, 3, 4  # actions of faults.c
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
    """Command line whose outputs are in its working directory.

    Attributes:
        name: Name of the command in the table.
        line: Arguments of pilotfish.
        outputs: Files and folders that it writes.
        old: Whether the outputs exist before, with other content.
    """

    name: str
    line: list[str]
    outputs: list[str]
    old: bool


def commands(inputs: Path) -> list[Command]:
    """Return every command that writes, once with missing outputs and once with old outputs and --force."""
    recordings, skill, rows = (str(inputs / name) for name in ("recordings", "a.skill", "rows"))
    stream = ["stream", rows, "--learner", "dp-gmm", "--cluster", "0.1", "--noise", "1e-3"]
    select = ["select", recordings, "--by", "likelihood", "--states", "2", "--structures", "full"]
    select += ["--max-iterations", "2"]
    via = ["--via-point", "position=0.5,0.5@1s+-0.01", "--via-plot", "via.png"]
    lines = {
        "learn": (["learn", recordings, "--states", "2", "--out", "new.skill"], ["new.skill"]),
        "stream": ([*stream, "--out", "a.stream", "--skill", "b.skill"], ["a.stream", "b.skill"]),
        "select": ([*select, "--out", "scores.png"], ["scores.png"]),
        "reproduce": (["reproduce", skill, "--out", "m.csv", "--gains", "g.npz"], ["m.csv", "g.npz"]),
        "reproduce plots": (["reproduce", skill, "--plot", "p.png", *via], ["p.png", "via.png"]),
        "show": (
            ["show", skill, "--plots", "."],
            ["deviations.png", "forward-variable.png", "states.png"],
        ),
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


def overwrite_command(inputs: Path) -> Command:
    """Return a command that writes its output in place: reproduce without atomic writes."""
    from pilotfish.cli.commands import reproduce

    @contextlib.contextmanager
    def write_in_place(path: Path, **_: Any) -> Iterator[Path]:
        yield path

    reproduce.atomic_file = write_in_place
    return Command(
        "in place", ["reproduce", str(inputs / "a.skill"), "--out", "m.csv", "--force"], ["m.csv"], True
    )


def make_old(command: Command, path: Path) -> None:
    """Write another output of the same kind."""
    if path.name != "set":
        path.write_bytes(b"the old content")
        return
    import numpy as np

    from pilotfish.demonstrations import demonstration, position_layout
    from pilotfish.io.demonstration_folder import write_demonstrations

    x = np.random.default_rng(1).normal(size=(5, 2))
    write_demonstrations([demonstration(x, 0.1, position_layout(2), (), "old")], path)


def make_inputs(inputs: Path) -> None:
    """Write short recordings, a skill of two states, and rows of numbers."""
    import numpy as np

    from pilotfish.demonstrations import add_derivatives, demonstration, position_layout
    from pilotfish.io.demonstration_folder import write_demonstrations
    from pilotfish.io.skill_file import save_skill
    from pilotfish.models import learn

    inputs.mkdir()
    rng, time = np.random.default_rng(0), np.linspace(0.0, 1.0, 30)
    arcs = [np.column_stack([time, np.sin(3.0 * time)]) + rng.normal(0.0, 0.01, (30, 2)) for _ in range(3)]
    demos = [demonstration(x, 0.1, position_layout(2), (), f"arc {m}") for m, x in enumerate(arcs)]
    write_demonstrations(demos, inputs / "recordings")
    save_skill(learn([add_derivatives(d) for d in demos], states=2, rng=rng).skill, inputs / "a.skill")
    np.savetxt(inputs / "rows", np.vstack(arcs))


CACHED_CALLS: "list[CachedCall]" = []


class CachedCall:
    """Function whose results are computed once and then returned in the order of the calls.

    Physics and learning are cached; writing never is.
    """

    def __init__(self, module: Any, name: str) -> None:
        self.real, self.results, self.calls = getattr(module, name), [], 0
        CACHED_CALLS.append(self)
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


class CachedRecordings(CachedCall):
    """Cache of simulation.record_demonstrations, a generator."""

    def result(self, *arguments: Any, **options: Any) -> Any:
        return list(self.real(*arguments, **options))


class CachedExecution(CachedCall):
    """Cache of simulation.perform, whose images a FilmRecorder records."""

    def result(self, *arguments: Any, **options: Any) -> Any:
        execution, recorder = self.real(*arguments, **options), options["on_period"]
        recorder.close()
        return execution, recorder.images, recorder.times, recorder.phases

    def given(self, result: Any, **options: Any) -> Any:
        recorder = options["on_period"]
        execution, recorder.images, recorder.times, recorder.phases = result
        return execution


def run_once(chosen: list[Command], inputs: Path) -> None:
    """Run each command once in this process, so that every child has its imports and cached results."""
    from pilotfish.cli.output import figures

    figures.DOTS_PER_INCH = 20  # small figures are faster
    lines = {command.name: command.line for command in chosen if not command.old}
    if {"record", "perform"} & set(lines):
        from pilotfish import simulation

        CachedRecordings(simulation, "record_demonstrations")
        record = ["record", "valve", "--demonstrations", "2", "--out", str(inputs / "valve")]
        run_in_process(record)
        run_in_process(
            ["learn", str(inputs / "valve"), "--states", "4", "--out", str(inputs / "valve.skill")]
        )
    for name, line in lines.items():
        cache_slow_calls(name)
        run_in_process(line)


def cache_slow_calls(name: str) -> None:
    """Cache the slow computations of a command."""
    if name == "select":
        from pilotfish.cli.commands import select

        CachedCall(select, "_score_candidates")
    if name == "perform":
        from pilotfish import simulation

        CachedExecution(simulation, "perform")
    if name == "demo":
        from pilotfish.cli.demo import run
        from pilotfish.cli.output import html_report

        CachedCall(run, "evaluate_structure")
        CachedCall(run, "execute_in_simulation")
        CachedCall(run, "report_sections")
        CachedCall(html_report, "render_report")


def run_in_process(line: list[str]) -> None:
    """Run a command line in this process, in a folder that is removed afterwards."""
    from click.testing import CliRunner

    from pilotfish.cli.main import cli

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        CliRunner().invoke(cli, line, prog_name="pilotfish", catch_exceptions=False)
    for function in CACHED_CALLS:
        function.calls = 0
