"""The demonstration: learn to open a valve, open it where it never stood, and draw what happened."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import click
import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.gaussians import Full, SemiTied, Structure
from pilotfish.models import learn
from pilotfish.station.demo_pages import sections
from pilotfish.station.evaluation import SETTINGS, STATES, TRAINED, replay, replay_from_mean
from pilotfish.station.lessons import Lesson, summary, tables
from pilotfish.station.report import Table, write_report
from pilotfish.store import datasets, save_skill, synthetic_valve

TITLE = "pilotfish: opening a valve where it never stood"
SYNTHETIC = (
    "SYNTHETIC DATA: the valve recording was not to be had, so a generated stand-in was used. No person and no "
    "robot made these demonstrations, and the numbers say nothing about the published experiment."
)
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class DemoResult:
    """Where report and skill of the demonstration lie, what it measured, and how long it took [s].

    synthetic tells that no recording was to be had.
    """

    report: Path
    skill: Path
    tables: tuple[Table, ...]
    synthetic: bool
    seconds: float


def demo(out: Path, *, seed: int = 0, say: Say = click.echo) -> DemoResult:
    """Learn from the first four openings of the valve, replay all eight, and write report and skill to out.

    Skills have seven states, with full and with semi-tied covariances; the semi-tied one is saved. say is
    told what goes on, a line or a table at a time.
    Raises: SkillError, when out cannot be written or PILOTFISH_DATA names something else than the recording.
    Source: Tanwani 2018, sections 3.4 and 4.3.1.
    """
    began, rng = perf_counter(), np.random.default_rng(seed)
    _make(out)
    shown, reason = _demonstrations(rng)
    notices = (f"{SYNTHETIC} Why: {reason}",) if reason else ()
    for notice in notices:
        say(f"\n*** {notice}\n")
    lessons = tuple(_lesson(shown, structure, rng, say) for structure in (Full(), SemiTied()))
    measured = (*(table for lesson in lessons for table in tables(lesson)), summary(lessons, not reason))
    for table in measured:
        say(f"\n{in_columns(table)}")
    report, skill = out / "report.html", out / "valve.skill"
    say("\ndrawing ...")
    save_skill(lessons[-1].fit.skill, skill)
    write_report(report, TITLE, sections(lessons, measured, notices))
    seconds = perf_counter() - began
    say(f"skill:  {skill}\nreport: {report}\n{seconds:.1f} s in all")
    return DemoResult(report, skill, measured, bool(reason), seconds)


@click.command("demo")
@click.option("--out", type=click.Path(path_type=Path), default=Path("build/demo"), show_default=True)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of every random choice."
)
def demo_command(out: Path, seed: int) -> None:
    """Learn to open a valve from four demonstrations, open it where it never stood, and draw what happened.

    Writes report.html and valve.skill to the folder OUT.

    \b
    Example:  pilotfish demo --out build/demo
    """
    try:
        demo(out, seed=seed)
    except SkillError as error:
        raise click.ClickException(str(error)) from error


def in_columns(table: Table) -> str:
    """The table for a terminal: the first column to the left, the others to the right."""
    lines = [table.head, *table.rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = [
        "  ".join(
            [first.ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(rest, widths[1:], strict=True))]
        )
        for first, *rest in lines
    ]
    return "\n".join([table.caption, *text])


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(f"{folder} cannot be made: {error.strerror}; choose another folder") from error


def _demonstrations(rng: np.random.Generator) -> tuple[tuple[Demonstration, ...], str]:
    """The recording; or the generated stand-in, and why.

    A recording that is there but wrong is not passed over.
    """
    try:
        return datasets.valve(), ""
    except InvalidInput:
        raise
    except SkillError as error:
        return synthetic_valve(rng), str(error)


def _lesson(
    shown: tuple[Demonstration, ...], structure: Structure, rng: np.random.Generator, say: Say
) -> Lesson:
    began = perf_counter()
    fit = learn(shown[:TRAINED], states=STATES, rng=rng, structure=structure, settings=SETTINGS)
    seconds = perf_counter() - began
    say(
        f"learned {STATES} states, {structure.label} covariances, from {TRAINED} demonstrations: "
        f"{fit.outcome.iterations} iterations, {seconds:.2f} s ({fit.outcome.reason})"
    )
    own = tuple(replay(fit.skill, demonstration) for demonstration in shown)
    mean = tuple(replay_from_mean(fit.skill, demonstration) for demonstration in shown)
    return Lesson(fit, structure, shown, own, mean, seconds)
