"""pilotfish data init: a template of a folder of demonstrations, to edit."""

from pathlib import Path

import click

from pilotfish.cli.output.demonstrations import demonstration_blocks, demonstration_to_json
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_folder,
)
from pilotfish.io import read_demonstrations, write_folder_template

COLUMNS = "position,orientation,gripper"


@click.command(
    name="init",
    epilog=example_epilog(
        "pilotfish data init my-task", "pilotfish data init my-pushes --columns position,gripper"
    ),
)
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "--columns",
    default=COLUMNS,
    show_default=True,
    metavar="LIST",
    help="Parts of a row: position, and perhaps orientation and gripper.",
)
@click.option("--force", is_flag=True, help="Replace an existing folder of demonstrations.")
@print_result
def write_template(folder: Path, columns: str, force: bool) -> CommandResult:
    """Write a template of demonstrations to FOLDER: a commented manifest and two small tables to replace.

    The comments of demonstrations.toml explain every key, unit and form of a frame. `data check`, `learn` and
    `reproduce` accept the template as it is.
    """
    names = _validate_columns(columns)
    require_writable_folder(folder, force=force)
    write_folder_template(folder, columns=names, overwrite=force)
    demonstrations = read_demonstrations(folder)
    manifest = folder / "demonstrations.toml"
    text = (
        f"written to {folder}\n"
        f"Replace the tables by your recordings, and edit {manifest}, whose comments explain each key.\n"
        f"Then check both: pilotfish data check {folder}"
    )
    result = {
        "folder": str(folder),
        "manifest": str(manifest),
        "demonstrations": [demonstration_to_json(demo) for demo in demonstrations],
    }
    return CommandResult([*demonstration_blocks(demonstrations), text], result)


def _validate_columns(columns: str) -> list[str]:
    names = [name.strip() for name in columns.split(",")]
    known = COLUMNS.split(",")
    if unknown := [name for name in names if name not in known]:
        raise click.BadParameter(
            f"{unknown[0]!r} is not one of {', '.join(known)}.", param_hint="'--columns'"
        )
    if len(set(names)) < len(names) or "position" not in names:
        raise click.BadParameter(
            f"{columns!r}, expected different names, with position among them.", param_hint="'--columns'"
        )
    return names
