"""pilotfish study: measure the value of assistance under delay with simulated operators."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.options.cluster import cluster_option
from pilotfish.cli.options.learning import seed_option
from pilotfish.cli.options.workers import require_one_pool, workers_option
from pilotfish.cli.output.figures import require_matplotlib, save_figure
from pilotfish.cli.output.html_report import Section, figure_image, write_report
from pilotfish.cli.output.results import CommandResult, example_epilog, print_result
from pilotfish.cli.output.tables import Table
from pilotfish.io import atomic_file
from pilotfish.rendering import require_mujoco

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLE = "pilotfish: the value of assistance under delay"
INTRODUCTION = (
    "Simulated operators do tasks with a simulated robot over a simulated link, in direct, shared and "
    "autonomous control and on a virtual fixture. Runs are paired: the modes are compared in the same "
    "situations with the same seeds. docs/study.md describes operators, conditions and simplifications."
)


@click.command(
    epilog=example_epilog("pilotfish study --quick --out quick-study", "pilotfish study --out study")
)
@click.option("--quick", is_flag=True, help="Run a small part, of 60 runs, to try the command.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("study"),
    show_default=True,
    help="Folder of runs, skills, tables and figures; with runs in it, the study continues.",
)
@seed_option
@workers_option
@cluster_option
@print_result
def study(quick: bool, out: Path, seed: int, workers: int | None, cluster: str | None) -> CommandResult:
    """Compare four modes of teleoperation with simulated operators, over delay, loss and displaced views.

    Every finished run is kept in the folder of --out. The same command continues a study that was stopped.
    Three operators do each task in five situations each. Times are relative to direct control in the same
    situations, with bootstrap intervals.
    """
    require_mujoco()
    require_matplotlib()
    from pilotfish.cli.study.execution import perform_runs
    from pilotfish.cli.study.figures import study_figures
    from pilotfish.cli.study.folder import lock_folder, open_folder
    from pilotfish.cli.study.results import Results
    from pilotfish.cli.study.tables import study_tables
    from pilotfish.simulation import study_runs

    pool = require_one_pool(workers, cluster)
    open_folder(out, seed=seed, quick=quick)
    runs = study_runs(quick=quick)
    with lock_folder(out):
        finished = perform_runs(out, runs, seed, pool, _command_line(out, seed, quick=quick))
        results = Results(runs, finished, seed)
        tables, figures = study_tables(results), study_figures(results)
        _write_report(out, tables, figures)
    cpu = sum(run["cpu"] for run in finished.values())
    blocks: list[str | Table] = [
        *tables,
        f"{len(runs)} runs, {cpu / 60.0:.1f} CPU minutes",
        f"written to {out}/report.html",
    ]
    data: dict[str, Any] = {
        "folder": str(out),
        "seed": seed,
        "quick": quick,
        "runs": len(runs),
        "cpu_seconds": cpu,
        "conditions": results.to_json(),
    }
    return CommandResult(blocks, data)


def _command_line(out: Path, seed: int, *, quick: bool) -> str:
    """Return the command line that continues the study."""
    options = ["--quick"] * quick + ["--out", str(out)] + ["--seed", str(seed)] * (seed != 0)
    return shlex.join(["pilotfish", "study", *options])


def _write_report(out: Path, tables: list[Table], figures: "dict[str, tuple[Figure, str]]") -> None:
    """Write the report, the tables as Markdown, and each figure."""
    from pilotfish.cli.study.tables import to_markdown

    images = []
    for name, (figure, caption) in figures.items():
        save_figure(figure, out / f"{name}.png", overwrite=True)
        images.append(figure_image(figure, caption, caption))
    with atomic_file(out / "study.md") as part:
        part.write_text(to_markdown(tables), encoding="utf-8")
    sections = (Section("What is compared", (INTRODUCTION,)), Section("Figures", tuple(images)))
    write_report(out / "report.html", TITLE, (*sections, Section("Tables", tuple(tables))))
