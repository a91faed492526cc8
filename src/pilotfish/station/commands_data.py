"""pilotfish data: the recordings there are, and whether a folder of one's own can be learned from."""

from dataclasses import asdict
from pathlib import Path

import click

from pilotfish.demonstrations import Demonstration, Finding, MovingFrame, Severity, check, write_folder
from pilotfish.station.answers import Answer, answering, example, plain_table, require_new_folder, table
from pilotfish.station.descriptions import columns_text
from pilotfish.station.sources import SYNTHETIC, dataset, recordings, require_dataset
from pilotfish.store import datasets

SYNTHETIC_ABOUT = "generated openings of a valve, made by no person: a stand-in that needs no download"


@click.group()
def data() -> None:
    """List, describe, check and export recordings."""


@data.command(name="list", epilog=example("pilotfish data list"))
@answering
def list_datasets() -> Answer:
    """List the data sets that can be learned from by name.

    Names go where a folder goes, as dataset:NAME. Put quotes around those with a blank.
    """
    about = {name: datasets.info(name).about for name in datasets.names()} | {SYNTHETIC: SYNTHETIC_ABOUT}
    return Answer(table(("name", "what"), list(about.items())), {"datasets": about})


@data.command(epilog=example("pilotfish data info valve"))
@click.argument("name")
@answering
def info(name: str) -> Answer:
    """Describe data set NAME: where it comes from, its licence and whom to cite."""
    require_dataset(name)
    if name == SYNTHETIC:
        return Answer(SYNTHETIC_ABOUT, {"name": name, "about": SYNTHETIC_ABOUT})
    facts = asdict(datasets.info(name))
    return Answer(plain_table(list(facts.items())), facts)


@data.command(name="check", epilog=example("pilotfish data check my-valve"))
@click.argument("folder")
@answering
def check_folder(folder: str) -> Answer:
    """Check the recordings in FOLDER and tell what is odd about them.

    Exit code 1 when they cannot be learned from together; warnings and notes leave it at 0.
    """
    demonstrations = recordings(folder)
    findings = check(demonstrations)
    facts = {
        "demonstrations": [_facts(demo) for demo in demonstrations],
        "findings": [_finding(finding) for finding in findings],
    }
    text = f"{_shown(demonstrations)}\n\n{_remarks(findings)}"
    return Answer(text, facts, code=int(any(finding.severity is Severity.ERROR for finding in findings)))


@data.command(epilog=example("pilotfish data export valve my-valve"))
@click.argument("name")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--force", is_flag=True, help="Replace a folder of demonstrations that is there already.")
@answering
def export(name: str, folder: Path, force: bool) -> Answer:
    """Write data set NAME to FOLDER, in the format that learn reads."""
    require_new_folder(folder, force=force)
    demonstrations = dataset(name)
    write_folder(demonstrations, folder, overwrite=force, beside=True)
    facts = {"folder": str(folder), "demonstrations": [_facts(demo) for demo in demonstrations]}
    return Answer(f"{_shown(demonstrations)}\n\nwritten to {folder}", facts)


def _shown(demonstrations: tuple[Demonstration, ...]) -> str:
    rows = [
        (str(m), demo.name, str(len(demo.x)), f"{len(demo.x) * demo.period:.4g}", _frames(demo))
        for m, demo in enumerate(demonstrations)
    ]
    columns = columns_text(demonstrations[0].layout)
    return f"{table(('', 'name', 'steps', 'seconds', 'frames'), rows)}\ncolumns: {columns}"


def _frames(demo: Demonstration) -> str:
    return ", ".join(f"{f.name} (moving)" if isinstance(f, MovingFrame) else f.name for f in demo.frames)


def _facts(demo: Demonstration) -> dict[str, object]:
    return {
        "name": demo.name,
        "steps": len(demo.x),
        "period": demo.period,
        "columns": list(demo.layout.names),
        "units": list(demo.layout.units),
        "frames": [frame.name for frame in demo.frames],
    }


def _remarks(findings: tuple[Finding, ...]) -> str:
    lines = [f"{finding.severity.value}: {finding.place} {finding.message}" for finding in findings]
    return "\n".join(lines) or "nothing odd was found"


def _finding(finding: Finding) -> dict[str, str]:
    return {"severity": finding.severity.value, "place": finding.place, "message": finding.message}
