"""pilotfish demo: the whole way from recordings to a motion, with a report to look at."""

from dataclasses import asdict
from pathlib import Path

import click

from pilotfish.cli.output.answers import CommandResult, example_epilog, print_result
from pilotfish.cli.output.pictures import require_matplotlib
from pilotfish.cli.output.terminal import is_json_output, print_line


@click.command(epilog=example_epilog("pilotfish demo --out build/demo"))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("build/demo"),
    show_default=True,
    help="The folder for the report and the skill; those of an earlier run are replaced.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the random number generator.",
)
@print_result
def demo(out: Path, seed: int) -> CommandResult:
    """Learn to open a valve from four demonstrations, open it where it never stood, and draw what happened.

    Without the recording, and without a network to fetch it, a generated one stands in and is named as such.
    """
    require_matplotlib()
    from pilotfish.cli.demo.demo import demo as run  # needs matplotlib

    result = run(out, seed=seed, print_line=_discard if is_json_output() else print_line)
    facts = {
        "report": str(result.report),
        "skill": str(result.skill),
        "synthetic": result.synthetic,
        "seconds": result.seconds,
        "tables": [asdict(table) for table in result.error_tables],
    }
    return CommandResult("", facts)


def _discard(text: str) -> None:
    """What people would read while they wait is left out for programs."""
