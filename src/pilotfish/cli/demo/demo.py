"""The demonstration: learn to open a valve, open it where it never stood, and draw what happened."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import click
import numpy as np

from pilotfish.cli.demo.demonstrations import StructureEvaluation, error_tables, summary_table
from pilotfish.cli.demo.pages import report_sections
from pilotfish.cli.demo.protocol import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    SETTINGS,
    STATES,
    TRAINING_DEMONSTRATIONS,
)
from pilotfish.cli.output.answers import require_writable_file
from pilotfish.cli.output.report import Section, Table, write_report
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.gaussians.structures import CovarianceStructure, Full, SemiTied
from pilotfish.io import datasets, make_folder, save_skill, synthetic_valve
from pilotfish.models import learn
from pilotfish.planning import reproduce_demonstration
from pilotfish.simulation import require_mujoco, require_renderer

TITLE = "pilotfish: opening a valve where it never stood"
SYNTHETIC_NOTICE = (
    "SYNTHETIC DATA: the valve recording was not to be had, so a generated stand-in was used. No person and "
    "no robot made these demonstrations, and the numbers say nothing about the published experiment."
)
PrintLine = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class DemoResult:
    """Where report and skill of the demonstration lie, what it measured, and how long it took [s].

    notice tells that no recording was to be had, and why; it is empty when one was.
    """

    report: Path
    skill: Path
    error_tables: tuple[Table, ...]
    notice: str
    seconds: float

    @property
    def synthetic(self) -> bool:
        return bool(self.notice)


def demo(out: Path, *, seed: int = 0, print_line: PrintLine = click.echo) -> DemoResult:
    """Learn from the first four openings of the valve, replay all eight, and write report and skill to out.

    Skills have seven states, with full and with semi-tied covariances; the semi-tied one is saved. say is
    told what is going on and what came out, a line or a table at a time.
    Raises: SkillError, when out cannot be written or PILOTFISH_DATA names something else than the recording.
    Source: Tanwani 2018, sections 3.4 and 4.3.1.
    """
    start_time, rng = perf_counter(), np.random.default_rng(seed)
    report, skill = out / "report.html", out / "valve.skill"
    make_folder(out)
    require_writable_file(report, skill, force=True)
    demonstrations, notice = _load_demonstrations(rng)
    if notice:
        print_line(f"*** {notice} ***")
    evaluations = [
        _evaluate_structure(demonstrations, structure, rng, print_line) for structure in (Full(), SemiTied())
    ]
    report_tables = (
        *(table for evaluation in evaluations for table in error_tables(evaluation)),
        summary_table(evaluations, published=not notice),
    )
    for table in report_tables:
        print_line(f"\n{format_report_table(table)}")
    save_skill(evaluations[-1].fit.skill, skill)
    physics, simulation_tables = _execute_in_simulation(evaluations[-1], print_line)
    write_report(report, TITLE, (*report_sections(evaluations, report_tables, notice), physics))
    report_tables = (*report_tables, *simulation_tables)
    seconds = perf_counter() - start_time
    print_line(f"\nskill:  {skill}\nreport: {report}\n{seconds:.1f} s in all")
    if notice:
        print_line(f"\n*** {SYNTHETIC_NOTICE} ***")
    return DemoResult(report, skill, report_tables, notice, seconds)


def format_report_table(table: Table) -> str:
    """The table for a terminal: the first column to the left, the others to the right."""
    lines = [table.header, *table.rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join([first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]) for first, *rest in lines]
    return "\n".join([table.caption, *text])


def _load_demonstrations(rng: np.random.Generator) -> tuple[tuple[Demonstration, ...], str]:
    """The recording; or the generated stand-in, and words that say so and why.

    A recording that is there but wrong is not passed over.
    """
    try:
        return datasets.valve(), ""
    except InvalidInput:
        raise
    except SkillError as error:
        return synthetic_valve(rng), f"{SYNTHETIC_NOTICE} Why: {error}"


def _execute_in_simulation(
    evaluation: StructureEvaluation, print_line: PrintLine
) -> tuple[Section, tuple[Table, ...]]:
    """The skill carried out by the robot in simulation; where that cannot be, words that say why."""
    try:
        require_mujoco()
    except SkillError as error:
        print_line(f"\nnot carried out in physics: {error}")
        return Section("In physics", (f"The replays were not carried out: {error}",)), ()
    from pilotfish.cli.demo.physics import simulate_reproductions  # needs MuJoCo

    pictures = _can_render(print_line)
    print_line(f"\ncarrying out {len(evaluation.demonstrations)} replays on a simulated robot ...")
    section, report_tables = simulate_reproductions(evaluation, pictures=pictures)
    print_line(f"\n{format_report_table(report_tables)}")
    return section, (report_tables,)


def _can_render(print_line: PrintLine) -> bool:
    try:
        require_renderer()
    except SkillError as error:
        print_line(f"\nno film of the physics: {error}")
        return False
    return True


def _evaluate_structure(
    demonstrations: tuple[Demonstration, ...],
    structure: CovarianceStructure,
    rng: np.random.Generator,
    print_line: PrintLine,
) -> StructureEvaluation:
    start_time = perf_counter()
    fit = learn(
        demonstrations[:TRAINING_DEMONSTRATIONS],
        states=STATES,
        rng=rng,
        structure=structure,
        settings=SETTINGS,
    )
    seconds = perf_counter() - start_time
    print_line(
        f"learned {STATES} states with {structure.label} covariances from {TRAINING_DEMONSTRATIONS} demonstrations: "
        f"{fit.convergence.iterations} iterations, {seconds:.2f} s; {fit.convergence.reason}"
    )
    from_first_point, mean = (
        tuple(
            reproduce_demonstration(
                fit.skill,
                demonstration,
                from_first_state=from_first_state,
                control_cost=CONTROL_COST,
                covariance_regularisation=COVARIANCE_REGULARISATION,
            )
            for demonstration in demonstrations
        )
        for from_first_state in (False, True)
    )
    return StructureEvaluation(fit, structure, demonstrations, from_first_point, mean, seconds)
