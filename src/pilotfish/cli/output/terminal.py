"""Printing of commands: a failure to print loses no result and causes no traceback.

Lines of the result are printed on standard output (`print_line`). The first failure is kept, later lines are
dropped, and the command ends with exit code 1 after its files are written (`print_failure`). Progress and
notes are printed on standard error; text that cannot be printed there is dropped.
"""

import os
import select
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import EAGAIN
from typing import Any, TextIO

import click

WAIT_INTERVAL = 0.25  # s, between checks while waiting for input or for a reader
CLEAR_LINE = "\r\x1b[K"  # return to the start of the line and clear it
FAILURE_KEY = "pilotfish.print_failure"  # of the metadata of the running command


def print_line(text: str, should_stop: Callable[[], object] | None = None) -> None:
    """Print text of the result on standard output, unless an earlier text could not be printed.

    Args:
        text: Text without its last line break.
        should_stop: Returns whether to stop waiting for a reader that does not read; None waits.
    """
    meta = click.get_current_context().meta
    if FAILURE_KEY in meta:
        return
    try:
        if should_stop is not None:
            _wait_for_reader(sys.stdout, should_stop)
        click.echo(_encodable(text, sys.stdout))
    except (OSError, ValueError) as error:  # ValueError: Python closed the stream
        meta[FAILURE_KEY] = error


def print_failure() -> Exception | None:
    """Return why this command could not print on standard output; None if it could."""
    failure: Exception | None = click.get_current_context().meta.get(FAILURE_KEY)
    return failure


def print_note(text: str) -> None:
    """Print a line on standard error, unless --json is given."""
    if not is_json_output():
        print_on_stderr(text)


def print_progress(text: str) -> None:
    """Replace the last line on standard error."""
    print_on_stderr(f"{CLEAR_LINE}{text}", newline=False)


def print_on_stderr(text: str, newline: bool = True) -> None:
    """Print on standard error, if that is possible."""
    click.echo(text, file=tolerant_stderr(), nl=newline)


def tolerant_stderr() -> Any:
    """Return standard error as a stream that drops text that cannot be printed."""
    return _TolerantStream(sys.stderr)


def is_json_output() -> bool:
    """Return whether the running command prints JSON."""
    return bool(click.get_current_context().params["as_json"])


def is_interactive() -> bool:
    """Return whether progress is printed: standard error is a terminal, and --json is not given."""
    return tolerant_stderr().isatty() and not is_json_output()


def terminal_width() -> int | None:
    """Return the number of columns of the terminal on standard output; None if it is not a terminal."""
    try:
        is_terminal = sys.stdout is not None and sys.stdout.isatty()
    except ValueError:  # closed
        return None
    return shutil.get_terminal_size().columns if is_terminal else None


@contextmanager
def progress_bar(length: int, label: str) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error if a person watches it.

    Args:
        length: Number of steps.
        label: Text before the bar.

    Yields:
        A function to call after each step, with a text to print after the bar; a second argument of 0
        replaces the text only.
    """
    if not is_interactive():
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[text]}"))
    console = Console(file=tolerant_stderr(), force_terminal=True)
    with Progress(*columns, console=console, transient=True, redirect_stdout=False) as progress:
        task = progress.add_task(label, total=length, text="")
        yield lambda text, steps=1: progress.update(task, advance=steps, text=text)


@contextmanager
def live_line() -> Iterator[Callable[[str], None]]:
    """Show one line on standard error that is replaced, if a person watches it.

    Yields:
        A function that replaces the line.
    """
    if not is_interactive():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    console = Console(file=tolerant_stderr(), force_terminal=True)
    with Live(console=console, transient=True, redirect_stdout=False) as live:
        yield lambda text: live.update(Text(text))


def discard_unprinted_text() -> None:
    """Send text that could not be printed to the null device; Python would print it again at exit."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):
            redirect_to_null(stream)


def redirect_to_null(stream: TextIO) -> None:
    """Redirect a stream, with its buffered text, to the null device; no reader is waited for."""
    with suppress(OSError, ValueError):
        null_device = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null_device, stream.fileno())
        os.close(null_device)


def open_closed_streams() -> None:
    """Replace each closed standard stream by one that cannot be written to.

    Without it, the next file that is opened gets the number of the stream, and receives what C libraries
    print on standard error. Text for a closed standard output would be dropped without a failure.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)  # gets the lowest free number, which is this descriptor
            if name != "stdin":
                setattr(sys, name, os.fdopen(descriptor, "w", closefd=False))


class _TolerantStream:
    """Text stream that drops what cannot be written; a closed stream, None, drops everything."""

    def __init__(self, stream: TextIO | None) -> None:
        self.stream = stream
        self.encoding = getattr(stream, "encoding", None) or "utf-8"

    def write(self, text: str) -> int:
        """Write text, if that is possible."""
        with suppress(OSError, ValueError):
            if self.stream is not None:
                self.stream.write(_encodable(text, self.stream))
        return len(text)

    def flush(self) -> None:
        """Flush the stream, if that is possible."""
        with suppress(OSError, ValueError):
            if self.stream is not None:
                self.stream.flush()

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
        try:
            return self.stream is not None and self.stream.isatty()
        except (OSError, ValueError):
            return False


def _encodable(text: str, stream: TextIO) -> str:
    """Return text with backslash escapes for characters that the encoding of a stream lacks."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding, getattr(stream, "errors", None) or "strict")
    except UnicodeEncodeError:
        return text.encode(encoding, "backslashreplace").decode(encoding)
    return text


def _wait_for_reader(stream: TextIO, should_stop: Callable[[], object]) -> None:
    """Return when a pipe or terminal accepts text; raise OSError if should_stop returns true before."""
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError):  # not a real file: writing never blocks
        return
    while not select.select([], [descriptor], [], WAIT_INTERVAL)[1]:
        if should_stop():
            raise OSError(EAGAIN, "no process reads it")
