"""The command `pilotfish`: learn, look at, and replay skills."""

import click

from pilotfish.station.answers import example
from pilotfish.station.commands_data import data
from pilotfish.station.commands_demo import demo
from pilotfish.station.commands_learn import learn
from pilotfish.station.commands_perform import perform
from pilotfish.station.commands_record import record, tasks
from pilotfish.station.commands_replay import replay
from pilotfish.station.commands_select import select
from pilotfish.station.commands_show import show
from pilotfish.station.commands_stream import stream


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog=example(
        "pilotfish learn dataset:valve --only 0-3 --out valve.skill", "pilotfish show valve.skill"
    ),
)
@click.version_option(package_name="pilotfish")
def cli() -> None:
    """Learn manipulation skills from a few demonstrations, and replay them in situations never shown.

    Every command has --help with an example, and --json for programs.
    """


cli.add_command(data)
cli.add_command(demo)
cli.add_command(learn)
cli.add_command(stream)
cli.add_command(select)
cli.add_command(show)
cli.add_command(replay)
cli.add_command(tasks)
cli.add_command(record)
cli.add_command(perform)


def main() -> None:
    """Run the command line; exit code 0 when it did what was asked, 1 when refused, 2 when misused."""
    cli(prog_name="pilotfish")
