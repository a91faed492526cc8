"""The demo: learn to open a valve, reproduce it in new situations, simulate it, and write a report."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import click
import numpy as np

from pilotfish.cli.demo.evaluation_tables import StructureEvaluation, error_tables, summary_table
from pilotfish.cli.demo.grasp_errors import grasp_error_table
from pilotfish.cli.demo.protocol import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    SETTINGS,
    STATES,
    TRAINING_DEMONSTRATIONS,
)
from pilotfish.cli.demo.report_sections import report_sections
from pilotfish.cli.output.html_report import Section, write_report
from pilotfish.cli.output.results import require_writable_file
from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.gaussians.structures import CovarianceStructure, Full, SemiTied
from pilotfish.io import datasets, make_folder, save_skill, synthetic_valve
from pilotfish.models import TimeBins, learn, structure_notes
from pilotfish.planning import reproduce_demonstration
from pilotfish.rendering import require_mujoco, require_renderer

TITLE = "pilotfish: opening a valve in new situations"
SYNTHETIC_NOTICE = (
    "SYNTHETIC DATA: the recorded demonstrations were not available, so generated ones were used. They come "
    "from no person and no robot, and the errors do not compare with the published experiment."
)
PrintLine = Callable[[str], None]


def run_demo(out: Path, *, seed: int = 0, print_line: PrintLine = click.echo) -> dict[str, Any]:
    """Learn from the first four valve demonstrations, reproduce all eight, and write a report and a skill.

    Two skills of seven states are learned, with full and with semi-tied covariances. The semi-tied one is
    saved, and executed in simulation.

    Args:
        out: Folder of the report and the skill.
        seed: Seed of the random number generator.
        print_line: Prints progress and tables.

    Returns:
        The output of the command: report and skill, the files; synthetic, whether generated data was used;
        seconds, the duration; and tables.

    Raises:
        SkillError: If the folder cannot be written, or PILOTFISH_DATA contains an invalid recording.

    Source:
        Tanwani 2018, sections 3.4 and 4.3.1.
    """
    start_time, rng = perf_counter(), np.random.default_rng(seed)
    report, skill = out / "report.html", out / "valve.skill"
    make_folder(out)
    require_writable_file(report, skill, force=True)
    demonstrations, notice = load_valve(rng)
    if notice:
        print_line(f"*** {notice} ***")
    evaluations = [
        evaluate_structure(demonstrations, structure, rng, print_line) for structure in (Full(), SemiTied())
    ]
    tables = (
        *(table for evaluation in evaluations for table in error_tables(evaluation)),
        summary_table(evaluations, published=not notice),
    )
    headline = grasp_error_table(evaluations[-1])
    for table in (*tables, headline):
        print_line(f"\n{table.to_text()}")
    save_skill(evaluations[-1].fit.skill, skill)
    section, simulation_tables = execute_in_simulation(evaluations[-1], print_line)
    write_report(report, TITLE, (*report_sections(evaluations, headline, tables, notice), section))
    seconds = perf_counter() - start_time
    print_line(f"\nskill:  {skill}\nreport: {report}\n{seconds:.1f} s in total")
    if notice:
        print_line(f"\n*** {SYNTHETIC_NOTICE} ***")
    return {
        "report": str(report),
        "skill": str(skill),
        "synthetic": bool(notice),
        "seconds": seconds,
        "tables": [asdict(table) for table in (headline, *tables, *simulation_tables)],
    }


def load_valve(rng: np.random.Generator) -> tuple[tuple[Demonstration, ...], str]:
    """Load the recorded demonstrations; if they are not available, generate some and say why.

    Args:
        rng: Random number generator for generated demonstrations.

    Returns:
        Demonstrations, and a notice that is empty for recorded ones.

    Raises:
        InvalidInput: If a recording exists but is invalid.
    """
    try:
        return datasets.valve(), ""
    except InvalidInput:
        raise
    except SkillError as error:
        return synthetic_valve(rng), f"{SYNTHETIC_NOTICE} Reason: {error}"


def execute_in_simulation(
    evaluation: StructureEvaluation, print_line: PrintLine
) -> tuple[Section, tuple[Table, ...]]:
    """Execute the reproductions in simulation.

    Args:
        evaluation: Reproductions to execute.
        print_line: Prints progress and tables.

    Returns:
        A section of the report and its tables; without MuJoCo, the section says what to install.
    """
    try:
        require_mujoco()
    except SkillError as error:
        print_line(f"\nnot executed in simulation: {error}")
        return Section("Simulation", (f"The reproductions were not executed in simulation: {error}",)), ()
    from pilotfish.cli.demo.physics import simulate_reproductions

    with_images = _can_render(print_line)
    print_line(f"\nexecuting {len(evaluation.demonstrations)} reproductions in simulation ...")
    section, table = simulate_reproductions(evaluation, with_images=with_images)
    print_line(f"\n{table.to_text()}")
    return section, (table,)


def _can_render(print_line: PrintLine) -> bool:
    try:
        require_renderer()
    except SkillError as error:
        print_line(f"\nno film of the simulation: {error}")
        return False
    return True


def evaluate_structure(
    demonstrations: tuple[Demonstration, ...],
    structure: CovarianceStructure,
    rng: np.random.Generator,
    print_line: PrintLine,
) -> StructureEvaluation:
    """Learn with one covariance structure and reproduce every demonstration from both starts."""
    start_time = perf_counter()
    fit = learn(
        demonstrations[:TRAINING_DEMONSTRATIONS],
        states=STATES,
        rng=rng,
        structure=structure,
        initialisation=TimeBins(),
        settings=SETTINGS,
    )
    seconds = perf_counter() - start_time
    print_line(
        f"learned {STATES} states with {structure.label} covariances from {TRAINING_DEMONSTRATIONS} "
        f"demonstrations: {fit.convergence.iterations} iterations, {seconds:.2f} s; {fit.convergence.reason}"
    )
    for note in (*fit.active_bounds, *structure_notes(fit.skill)):
        print_line(f"note: {note}")
    from_first_point, from_first_state = (
        tuple(
            reproduce_demonstration(
                fit.skill,
                demonstration,
                from_first_state=from_first_state,
                control_cost=CONTROL_COST,
                covariance_regularisation=COVARIANCE_REGULARISATION,
                stepwise=True,
            )
            for demonstration in demonstrations
        )
        for from_first_state in (False, True)
    )
    return StructureEvaluation(fit, structure, demonstrations, from_first_point, from_first_state, seconds)
