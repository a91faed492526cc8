"""pilotfish view: a page in the browser with demonstrations and a skill, whose objects can be dragged."""

import json
from pathlib import Path
from typing import Any

import click

from pilotfish.cli.options.demonstrations import (
    DATASET_PREFIX,
    load_demonstrations,
    match_skill,
    only_option,
    select_demonstrations,
)
from pilotfish.cli.output.results import CommandResult, example_epilog, print_result
from pilotfish.cli.output.tables import key_value_table
from pilotfish.cli.output.terminal import is_json_output, print_line, print_note, terminal_width
from pilotfish.cli.stream.signals import StopRequested, catch_signals
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io import is_folder, load_any, path_exists, read_frames
from pilotfish.models import Skill, online

FILE, SKILL_SUFFIX = click.Path(path_type=Path), ".skill"
DEFAULT_PORT, MAX_PORT = 8080, 65535


@click.command(
    epilog=example_epilog(
        "pilotfish view dataset:valve --skill valve.skill",
        "pilotfish view valve.skill --port 0 --open",
    )
)
@click.argument("source", metavar="FOLDER|SKILL")
@click.option("--skill", type=FILE, help="Skill to reproduce beside the demonstrations in FOLDER.")
@click.option(
    "--frames", type=FILE, help="JSON or TOML file with the pose of every frame, for a further situation."
)
@only_option
@click.option(
    "--port",
    type=click.IntRange(0, MAX_PORT),
    default=DEFAULT_PORT,
    show_default=True,
    help="Port of the page; 0 takes any free one.",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to bind. Whoever can reach it can read and change the page, without a password.",
)
@click.option("--open/--no-browser", "open_page", default=False, help="Open the page in the default browser.")
@print_result
def view(source: str, skill: Path | None, frames: Path | None, only: str, **options: Any) -> CommandResult:
    """Open a page in the browser with the demonstrations in FOLDER, or with the file SKILL.

    FOLDER may also be dataset:NAME, and SKILL a stream file. Drag an object: the skill is adapted, and its
    motion planned, at once. Ctrl-C ends the command.
    """
    from pilotfish import panel

    demonstrations, learned = _load(source, skill, only)
    if frames and learned is None:
        raise click.UsageError("--frames has no effect without a skill; give --skill FILE")
    given = read_frames(frames, learned) if frames and learned else None
    try:
        content = panel.view_content(demonstrations, learned, given)
    except InvalidInput as error:
        raise InvalidInput(str(error).replace("pass them, or", "give --frames FILE, or")) from error
    if not panel.is_loopback(options["host"]):
        print_note(f"note: whoever can reach {options['host']} can read and change the page")

    def announce(address: str) -> None:
        _print_address(address, content)
        if options["open_page"]:
            click.launch(address)

    with catch_signals() as stopped_by:
        panel.serve(content, stopped_by, host=options["host"], port=options["port"], on_start=announce)
        number = stopped_by()
    raise StopRequested(number)


def _load(source: str, skill: Path | None, only: str) -> tuple[tuple[Demonstration, ...], Skill | None]:
    """Return the demonstrations of a folder and the skill beside them, or a skill alone."""
    path = Path(source)
    is_missing = not path_exists(path) and path.suffix != SKILL_SUFFIX  # a missing skill is reported as one
    is_set = source.startswith(DATASET_PREFIX) or is_folder(path) or is_missing
    if is_set:
        demonstrations = select_demonstrations(load_demonstrations(source), only)
        learned = _load_skill(skill) if skill else None
        if learned is None:
            return demonstrations, None
        return tuple(match_skill(demo, learned) for demo in demonstrations), learned
    if skill or only:
        option = "--skill" if skill else "--only"
        raise click.UsageError(
            f"{option} has no effect on the file {source}; give a folder of demonstrations"
        )
    return (), _load_skill(path)


def _load_skill(path: Path) -> Skill:
    loaded = load_any(path)
    return loaded if isinstance(loaded, Skill) else online.to_skill(loaded)


def _print_address(address: str, content: Any) -> None:
    """Print where the page is, for people or for programs."""
    counts = {
        "demonstrations": len(content.demonstrations),
        "states": content.skill.states if content.skill else 0,
        "situations": len(content.situations),
    }
    if is_json_output():
        print_line(json.dumps({"address": address, **counts}))
    else:
        rows = [(name, str(count)) for name, count in counts.items() if count]
        table = key_value_table([("page", address), *rows, ("end", "Ctrl-C")])
        print_line(table.to_text(terminal_width()))
