"""pilotfish demo: from demonstrations to motions, with a report."""

from pathlib import Path

import click

from pilotfish.cli.options.learning import seed_option
from pilotfish.cli.output.figures import require_matplotlib
from pilotfish.cli.output.results import CommandResult, example_epilog, print_result
from pilotfish.cli.output.terminal import is_json_output, print_line


@click.command(epilog=example_epilog("pilotfish demo --out build/demo"))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("build/demo"),
    show_default=True,
    help="Folder of the report and the skill; files of an earlier run are replaced.",
)
@seed_option
@print_result
def demo(out: Path, seed: int) -> CommandResult:
    """Learn to open a valve from four demonstrations, reproduce it in new situations, and write a report.

    If the recorded demonstrations are missing and cannot be downloaded, generated ones are used; the output
    says so.
    """
    require_matplotlib()
    from pilotfish.cli.demo.run import run_demo

    return CommandResult(
        (), run_demo(out, seed=seed, print_line=_discard if is_json_output() else print_line)
    )


def _discard(_: str) -> None:
    """Print no progress, because the output is JSON."""
