"""pilotfish data: list, describe, import, check and export demonstrations; write a template."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click

from pilotfish.cli.commands.data_import import import_recordings
from pilotfish.cli.commands.data_init import write_template
from pilotfish.cli.options.demonstrations import (
    SYNTHETIC_NAME,
    load_dataset,
    load_demonstrations,
    require_dataset,
)
from pilotfish.cli.output.demonstrations import demonstration_blocks, demonstration_to_json
from pilotfish.cli.output.diagnostics import format_diagnostic
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_folder,
)
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.demonstrations import Demonstration, diagnose, resample_to_period
from pilotfish.io import datasets, is_folder, write_demonstrations
from pilotfish.io.writers import WRITERS, export_demonstrations

SYNTHETIC_DESCRIPTION = "generated demonstrations of opening a valve; they need no download"


@click.group()
def data() -> None:
    """List, describe, import, check and export demonstrations."""


data.add_command(import_recordings)
data.add_command(write_template)


@data.command(name="list", epilog=example_epilog("pilotfish data list"))
@print_result
def list_datasets() -> CommandResult:
    """List the data sets that can be used by name.

    Other commands accept dataset:NAME instead of a folder. Quote names that contain a blank.
    """
    descriptions = {name: datasets.info(name).description for name in datasets.names()}
    descriptions[SYNTHETIC_NAME] = SYNTHETIC_DESCRIPTION
    table = Table(("name", "description"), tuple(descriptions.items()))
    return CommandResult([table], {"datasets": descriptions})


@data.command(epilog=example_epilog("pilotfish data info valve"))
@click.argument("name")
@print_result
def info(name: str) -> CommandResult:
    """Describe data set NAME: its source, licence and citation."""
    require_dataset(name)
    if name == SYNTHETIC_NAME:
        result = {"name": name, "description": SYNTHETIC_DESCRIPTION}
    else:
        result = asdict(datasets.info(name))
    return CommandResult([key_value_table(list(result.items()))], result)


@data.command(name="check", epilog=example_epilog("pilotfish data check my-valve"))
@click.argument("folder")
@print_result
def check_folder(folder: str) -> CommandResult:
    """Check the demonstrations in FOLDER and report problems.

    The exit code is 1 if a skill cannot be learned from them; warnings and notes do not change it.
    """
    demonstrations = load_demonstrations(folder)
    diagnostics = diagnose(demonstrations)
    lines = [format_diagnostic(diagnostic, folder) for diagnostic in diagnostics]
    result = {
        "demonstrations": [demonstration_to_json(demo) for demo in demonstrations],
        "diagnostics": [
            {"severity": d.severity, "location": d.location, "kind": d.kind, "message": d.message}
            for d in diagnostics
        ],
    }
    return CommandResult(
        [*demonstration_blocks(demonstrations), "\n".join(lines) or "No problems were found."],
        result,
        exit_code=int(any(d.severity == "error" for d in diagnostics)),
    )


@data.command(
    epilog=example_epilog(
        "pilotfish data export valve my-valve",
        "pilotfish data export my-valve valve-lerobot --format lerobot",
        "pilotfish data export my-valve valve-csv --format csv --period 0.02",
    )
)
@click.argument("name")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "form",
    type=click.Choice(["pilotfish", *WRITERS]),
    default="pilotfish",
    show_default=True,
    help="Format: a folder that `learn` reads, a LeRobot data set, a robomimic file, ROS 2 bags (MCAP), or a "
    "folder of CSV tables.",
)
@click.option(
    "--period",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    help="Time between two rows to resample to, such as that of a controller [s].  [default: as recorded]",
)
@click.option("--force", is_flag=True, help="Replace an existing output of the same format.")
@print_result
def export(name: str, folder: Path, form: str, period: float | None, force: bool) -> CommandResult:
    """Write data set NAME, or a folder of demonstrations, to FOLDER in a format of your choice.

    With --period, orientations are interpolated by slerp, columns that switch take the nearest value, and
    velocities are computed again.
    """
    if form == "pilotfish":
        require_writable_folder(folder, force=force)
    loaded = _load_folder_or_dataset(name)
    demonstrations = loaded if period is None else tuple(resample_to_period(demo, period) for demo in loaded)
    notes = _export_notes(loaded, demonstrations, form)
    if form == "pilotfish":
        write_demonstrations(demonstrations, folder, overwrite=force, use_free_name=True)
    else:
        export_demonstrations(demonstrations, folder, form, overwrite=force)
    result = {
        "folder": str(folder),
        "format": form,
        "demonstrations": [demonstration_to_json(demo) for demo in demonstrations],
        "notes": notes,
    }
    text = "\n".join([*(f"note: {note}" for note in notes), f"written to {folder}"])
    return CommandResult([*demonstration_blocks(demonstrations), text], result)


def _export_notes(loaded: Sequence[Demonstration], written: Sequence[Demonstration], form: str) -> list[str]:
    notes = []
    first, last = loaded[0], written[0]
    if last.period != first.period:
        notes.append(f"resampled from {first.period:g} s to {last.period:g} s between two rows")
        if last.layout != first.layout:
            notes.append("derivatives are left out: they are not those of all parts")
    if form == "csv":
        notes.append("import.toml has the settings of `pilotfish data import FOLDER --settings`, if needed")
    return notes


def _load_folder_or_dataset(name: str) -> tuple[Demonstration, ...]:
    """Load a data set by its name, or a folder if no data set has this name."""
    if name not in (*datasets.names(), SYNTHETIC_NAME) and is_folder(name):
        return load_demonstrations(name)
    return load_dataset(name)
