"""pilotfish demo: the whole way from recordings to a motion, with a report to look at."""

from dataclasses import asdict
from pathlib import Path

import click

from pilotfish.station.answers import Answer, answering, example
from pilotfish.station.output import as_json, say
from pilotfish.station.pictures import require_matplotlib


@click.command(epilog=example("pilotfish demo --out build/demo"))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("build/demo"),
    show_default=True,
    help="The folder for the report and the skill; those of an earlier run are replaced.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of all chance.")
@answering
def demo(out: Path, seed: int) -> Answer:
    """Learn to open a valve from four demonstrations, open it where it never stood, and draw what happened.

    Without the recording, and without a network to fetch it, a generated one stands in and is named as such.
    """
    require_matplotlib()
    from pilotfish.station.demo import demo as run  # needs matplotlib

    result = run(out, seed=seed, say=_silent if as_json() else say)
    facts = {
        "report": str(result.report),
        "skill": str(result.skill),
        "synthetic": result.synthetic,
        "seconds": result.seconds,
        "tables": [asdict(table) for table in result.tables],
    }
    return Answer("", facts)


def _silent(text: str) -> None:
    """What people would read while they wait is left out for programs."""
