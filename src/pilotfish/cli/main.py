"""The command `pilotfish`: learn, look at, and replay skills."""

import sys
import traceback
from typing import Any

import click

from pilotfish.cli.commands.data import data
from pilotfish.cli.commands.demo import demo
from pilotfish.cli.commands.learn import learn
from pilotfish.cli.commands.perform import perform
from pilotfish.cli.commands.record import record, tasks
from pilotfish.cli.commands.reproduce import reproduce_command
from pilotfish.cli.commands.select import select
from pilotfish.cli.commands.show import show
from pilotfish.cli.commands.stream import stream
from pilotfish.cli.output.answers import example_epilog
from pilotfish.cli.output.terminal import (
    discard_unprinted_text,
    open_closed_streams,
    print_on_stderr,
    redirect_to_null,
    tolerant_stderr,
)
from pilotfish.cli.stream.signals import (
    SIGNAL_EXIT_OFFSET,
    StopRequested,
    raise_on_signals,
    restore_default_signals,
)
from pilotfish.errors import SkillError


class OneLineErrorGroup(click.Group):
    """Commands whose misuse is reported in one bounded, printable line, as every other error is."""

    def make_context(self, *args: Any, **options: Any) -> click.Context:
        try:
            return super().make_context(*args, **options)
        except click.UsageError as error:
            raise _shorten_message(error) from None

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            raise _shorten_message(error) from None


def _shorten_message(error: click.UsageError) -> click.UsageError:
    error.message = str(SkillError(error.message))  # type: ignore[misc] # click keeps no other way
    return error


@click.group(
    cls=OneLineErrorGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog=example_epilog(
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
cli.add_command(reproduce_command)
cli.add_command(tasks)
cli.add_command(record)
cli.add_command(perform)


def main() -> None:
    """Run the command line and exit.

    The exit code is 0 when it did what was asked, 1 when it was refused or its answer could not be printed, 2
    when it was misused, and 128 + n when signal n stopped it.
    """
    open_closed_streams()
    try:
        raise_on_signals()
        code = _run()
        restore_default_signals()
    except StopRequested as stopped:
        restore_default_signals()
        redirect_to_null(sys.stdout)  # it may have been stopped while it waited for a reader
        print_on_stderr(f"stopped by {stopped}")
        code = SIGNAL_EXIT_OFFSET + stopped.number
    discard_unprinted_text()
    sys.exit(code)


def _run() -> int:
    """Run the command line and return its exit code."""
    try:
        return cli.main(prog_name="pilotfish", standalone_mode=False) or 0
    except click.ClickException as error:
        error.show(tolerant_stderr())
        return error.exit_code
    except OSError as error:
        if not _is_raised_by_click(error):
            raise
        print_on_stderr(f"Error: standard output cannot be written: {error.strerror}")
        return 1


def _is_raised_by_click(error: OSError) -> bool:
    """Whether click could not print a help text; what commands print is guarded where it is printed."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    return str(frame.f_globals["__name__"]) == click.utils.__name__
