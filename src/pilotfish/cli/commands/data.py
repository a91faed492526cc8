"""pilotfish data: the recordings there are, and whether a folder of one's own can be learned from."""

from dataclasses import asdict
from pathlib import Path

import click

from pilotfish.cli.options.sources import SYNTHETIC_NAME, load_dataset, load_demonstrations, require_dataset
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_key_values,
    format_table,
    print_result,
    require_writable_folder,
)
from pilotfish.cli.output.descriptions import format_columns
from pilotfish.demonstrations import (
    Demonstration,
    Diagnostic,
    diagnose,
)
from pilotfish.io import datasets, write_demonstrations

SYNTHETIC_DESCRIPTION = "generated openings of a valve, made by no person: a stand-in that needs no download"


@click.group()
def data() -> None:
    """List, describe, check and export recordings."""


@data.command(name="list", epilog=example_epilog("pilotfish data list"))
@print_result
def list_datasets() -> CommandResult:
    """List the data sets that can be learned from by name.

    Names go where a folder goes, as dataset:NAME. Put quotes around those with a blank.
    """
    about = {name: datasets.info(name).description for name in datasets.names()} | {
        SYNTHETIC_NAME: SYNTHETIC_DESCRIPTION
    }
    return CommandResult(format_table(("name", "what"), list(about.items())), {"datasets": about})


@data.command(epilog=example_epilog("pilotfish data info valve"))
@click.argument("name")
@print_result
def info(name: str) -> CommandResult:
    """Describe data set NAME: where it comes from, its licence and whom to cite."""
    require_dataset(name)
    if name == SYNTHETIC_NAME:
        return CommandResult(SYNTHETIC_DESCRIPTION, {"name": name, "about": SYNTHETIC_DESCRIPTION})
    facts = asdict(datasets.info(name))
    return CommandResult(format_key_values(list(facts.items())), facts)


@data.command(name="check", epilog=example_epilog("pilotfish data check my-valve"))
@click.argument("folder")
@print_result
def check_folder(folder: str) -> CommandResult:
    """Check the recordings in FOLDER and tell what is odd about them.

    Exit code 1 when they cannot be learned from together; warnings and notes leave it at 0.
    """
    demonstrations = load_demonstrations(folder)
    diagnostics = diagnose(demonstrations)
    facts = {
        "demonstrations": [_demonstration_to_json(demo) for demo in demonstrations],
        "diagnostics": [_diagnostic_to_json(finding) for finding in diagnostics],
    }
    text = f"{_format_demonstrations(demonstrations)}\n\n{_format_diagnostics(diagnostics)}"
    return CommandResult(
        text, facts, exit_code=int(any(finding.severity == "error" for finding in diagnostics))
    )


@data.command(epilog=example_epilog("pilotfish data export valve my-valve"))
@click.argument("name")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--force", is_flag=True, help="Replace a folder of demonstrations that is there already.")
@print_result
def export(name: str, folder: Path, force: bool) -> CommandResult:
    """Write data set NAME to FOLDER, in the format that learn reads."""
    require_writable_folder(folder, force=force)
    demonstrations = load_dataset(name)
    write_demonstrations(demonstrations, folder, overwrite=force, use_free_name=True)
    facts = {
        "folder": str(folder),
        "demonstrations": [_demonstration_to_json(demo) for demo in demonstrations],
    }
    return CommandResult(f"{_format_demonstrations(demonstrations)}\n\nwritten to {folder}", facts)


def _format_demonstrations(demonstrations: tuple[Demonstration, ...]) -> str:
    rows = [
        (str(m), demo.name, str(len(demo.x)), f"{len(demo.x) * demo.period:.4g}", _format_frames(demo))
        for m, demo in enumerate(demonstrations)
    ]
    columns = format_columns(demonstrations[0].layout)
    return f"{format_table(('', 'name', 'steps', 'seconds', 'frames'), rows)}\ncolumns: {columns}"


def _format_frames(demo: Demonstration) -> str:
    return ", ".join(f"{f.name} (moving)" if f.is_moving else f.name for f in demo.frames)


def _demonstration_to_json(demo: Demonstration) -> dict[str, object]:
    return {
        "name": demo.name,
        "steps": len(demo.x),
        "period": demo.period,
        "columns": list(demo.layout.names),
        "units": list(demo.layout.units),
        "frames": [frame.name for frame in demo.frames],
    }


def _format_diagnostics(diagnostics: tuple[Diagnostic, ...]) -> str:
    lines = [f"{finding.severity}: {finding.location} {finding.message}" for finding in diagnostics]
    return "\n".join(lines) or "no problems found"


def _diagnostic_to_json(finding: Diagnostic) -> dict[str, str]:
    return {"severity": finding.severity, "location": finding.location, "message": finding.message}
