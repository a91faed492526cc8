"""The demonstration: learn to open a valve, open it where it never stood, and draw what happened."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import click
import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.files import make_folder
from pilotfish.gaussians import Full, SemiTied, Structure
from pilotfish.models import learn
from pilotfish.station.answers import require_new
from pilotfish.station.demo_pages import sections
from pilotfish.station.evaluation import SETTINGS, STATES, TRAINED, replay, replay_from_mean
from pilotfish.station.lessons import Lesson, summary, tables
from pilotfish.station.rendering import require_mujoco, require_renderer
from pilotfish.station.report import Section, Table, write_report
from pilotfish.store import datasets, save_skill, synthetic_valve

TITLE = "pilotfish: opening a valve where it never stood"
SYNTHETIC = (
    "SYNTHETIC DATA: the valve recording was not to be had, so a generated stand-in was used. No person and "
    "no robot made these demonstrations, and the numbers say nothing about the published experiment."
)
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class DemoResult:
    """Where report and skill of the demonstration lie, what it measured, and how long it took [s].

    notice tells that no recording was to be had, and why; it is empty when one was.
    """

    report: Path
    skill: Path
    tables: tuple[Table, ...]
    notice: str
    seconds: float

    @property
    def synthetic(self) -> bool:
        return bool(self.notice)


def demo(out: Path, *, seed: int = 0, say: Say = click.echo) -> DemoResult:
    """Learn from the first four openings of the valve, replay all eight, and write report and skill to out.

    Skills have seven states, with full and with semi-tied covariances; the semi-tied one is saved. say is
    told what is going on and what came out, a line or a table at a time.
    Raises: SkillError, when out cannot be written or PILOTFISH_DATA names something else than the recording.
    Source: Tanwani 2018, sections 3.4 and 4.3.1.
    """
    began, rng = perf_counter(), np.random.default_rng(seed)
    report, skill = out / "report.html", out / "valve.skill"
    make_folder(out)
    require_new(report, skill, force=True)
    shown, notice = _demonstrations(rng)
    if notice:
        say(f"*** {notice} ***")
    lessons = [_lesson(shown, structure, rng, say) for structure in (Full(), SemiTied())]
    measured = (
        *(table for lesson in lessons for table in tables(lesson)),
        summary(lessons, published=not notice),
    )
    for table in measured:
        say(f"\n{in_columns(table)}")
    save_skill(lessons[-1].fit.skill, skill)
    physics, carried_out = _in_physics(lessons[-1], say)
    write_report(report, TITLE, (*sections(lessons, measured, notice), physics))
    measured = (*measured, *carried_out)
    seconds = perf_counter() - began
    say(f"\nskill:  {skill}\nreport: {report}\n{seconds:.1f} s in all")
    if notice:
        say(f"\n*** {SYNTHETIC} ***")
    return DemoResult(report, skill, measured, notice, seconds)


def in_columns(table: Table) -> str:
    """The table for a terminal: the first column to the left, the others to the right."""
    lines = [table.head, *table.rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join([first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]) for first, *rest in lines]
    return "\n".join([table.caption, *text])


def _demonstrations(rng: np.random.Generator) -> tuple[tuple[Demonstration, ...], str]:
    """The recording; or the generated stand-in, and words that say so and why.

    A recording that is there but wrong is not passed over.
    """
    try:
        return datasets.valve(), ""
    except InvalidInput:
        raise
    except SkillError as error:
        return synthetic_valve(rng), f"{SYNTHETIC} Why: {error}"


def _in_physics(lesson: Lesson, say: Say) -> tuple[Section, tuple[Table, ...]]:
    """The skill carried out by the robot in simulation; where that cannot be, words that say why."""
    try:
        require_mujoco()
    except SkillError as error:
        say(f"\nnot carried out in physics: {error}")
        return Section("In physics", (f"The replays were not carried out: {error}",)), ()
    from pilotfish.station.demo_physics import opened  # needs MuJoCo

    pictures = _pictures(say)
    say(f"\ncarrying out {len(lesson.shown)} replays on a simulated robot ...")
    section, measured = opened(lesson, pictures=pictures)
    say(f"\n{in_columns(measured)}")
    return section, (measured,)


def _pictures(say: Say) -> bool:
    try:
        require_renderer()
    except SkillError as error:
        say(f"\nno film of the physics: {error}")
        return False
    return True


def _lesson(
    shown: tuple[Demonstration, ...], structure: Structure, rng: np.random.Generator, say: Say
) -> Lesson:
    began = perf_counter()
    fit = learn(shown[:TRAINED], states=STATES, rng=rng, structure=structure, settings=SETTINGS)
    seconds = perf_counter() - began
    say(
        f"learned {STATES} states with {structure.label} covariances from {TRAINED} demonstrations: "
        f"{fit.outcome.iterations} iterations, {seconds:.2f} s; {fit.outcome.reason}"
    )
    own = tuple(replay(fit.skill, demonstration) for demonstration in shown)
    mean = tuple(replay_from_mean(fit.skill, demonstration) for demonstration in shown)
    return Lesson(fit, structure, shown, own, mean, seconds)
