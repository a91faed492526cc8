"""The command `pilotfish`: all commands, exit codes and errors."""

import sys
import traceback
from typing import Any

import click

from pilotfish.cli.commands.data import data
from pilotfish.cli.commands.demo import demo
from pilotfish.cli.commands.drive import drive
from pilotfish.cli.commands.frames import calibrate, frames, markers
from pilotfish.cli.commands.learn import learn
from pilotfish.cli.commands.mission import mission
from pilotfish.cli.commands.perform import perform
from pilotfish.cli.commands.record import record, tasks
from pilotfish.cli.commands.replay_session import replay_session_command
from pilotfish.cli.commands.reproduce import reproduce_command
from pilotfish.cli.commands.select import select
from pilotfish.cli.commands.show import show
from pilotfish.cli.commands.stream import stream
from pilotfish.cli.commands.study import study
from pilotfish.cli.commands.view import view
from pilotfish.cli.output.results import example_epilog
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

COMMANDS = (
    data,
    demo,
    learn,
    stream,
    select,
    show,
    reproduce_command,
    view,
    tasks,
    record,
    perform,
    drive,
    mission,
    replay_session_command,
    study,
    frames,
    calibrate,
    markers,
)
RENAMED_COMMANDS = {"replay": "reproduce"}


class OneLineErrorGroup(click.Group):
    """Group of commands whose usage errors are one printable line of bounded length."""

    def make_context(self, *args: Any, **options: Any) -> click.Context:
        """Parse the command line."""
        try:
            return super().make_context(*args, **options)
        except click.UsageError as error:
            raise _shorten_message(error) from None

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            raise _shorten_message(error) from None

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by name; name its successor if the command was renamed."""
        if new_name := RENAMED_COMMANDS.get(cmd_name):
            raise click.UsageError(f"command {cmd_name!r} is now {new_name!r}: pilotfish {new_name}", ctx)
        return super().get_command(ctx, cmd_name)


def _shorten_message(error: click.UsageError) -> click.UsageError:
    error.message = str(SkillError(error.message))  # type: ignore[misc] # click has no other way
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
    """Learn manipulation skills from a few demonstrations and reproduce them in new situations.

    Every command has --help with an example, and --json for programs.
    """


for command in COMMANDS:
    cli.add_command(command)


def main() -> None:
    """Run the command line and exit.

    The exit code is 0 after success and 2 after a usage error. It is 1 after another error, or if the result
    could not be printed, and 128 + n after signal n.
    """
    open_closed_streams()
    try:
        raise_on_signals()
        exit_code = _run()
        restore_default_signals()
    except StopRequested as stopped:
        restore_default_signals()
        redirect_to_null(sys.stdout)  # the signal may have interrupted a wait for a reader
        print_on_stderr(f"stopped by {stopped}")
        exit_code = SIGNAL_EXIT_OFFSET + stopped.number
    discard_unprinted_text()
    sys.exit(exit_code)


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
    """Return whether click failed to print a help text; printing of results handles its own errors."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    return str(frame.f_globals["__name__"]) == click.utils.__name__
