"""Everything that commands print. A failure to print never costs a result, and is never a traceback.

Lines of the answer go to standard output (`say`). The first failure there is kept, later lines are dropped,
and the command ends with exit code 1 once its files are written (`print_failure`). Progress and remarks go to
standard error; what cannot be printed there is dropped.
"""

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import EAGAIN
from typing import Any, TextIO

import click

WAIT_INTERVAL = 0.25  # s, after which something that waits looks up
CLEAR_LINE = "\r\x1b[K"  # the start of the line, and nothing on it
FAILURE_KEY = "pilotfish.print_failure"  # where the context of the running command keeps it


def print_line(text: str, should_stop: Callable[[], object] | None = None) -> None:
    """Print a line of the answer on standard output, unless an earlier line could not be printed.

    Args:
        text: The line.
        stopped: Whether to give up on a reader that does not read; None waits for it.
    """
    meta = click.get_current_context().meta
    if FAILURE_KEY in meta:
        return
    try:
        if should_stop is not None:
            _wait_for_reader(sys.stdout, should_stop)
        click.echo(_encodable(text, sys.stdout))
    except (OSError, ValueError) as error:  # ValueError: closed by Python
        meta[FAILURE_KEY] = error


def print_failure() -> Exception | None:
    """Return why standard output could not be printed to by this command; None where it could."""
    failure: Exception | None = click.get_current_context().meta.get(FAILURE_KEY)
    return failure


def print_note(text: str) -> None:
    """Print a line on standard error, out of the way of the answer; nothing with --json."""
    if not is_json_output():
        print_on_stderr(text)


def print_progress(text: str) -> None:
    """Print in place of the last line on standard error."""
    print_on_stderr(f"{CLEAR_LINE}{text}", newline=False)


def print_on_stderr(text: str, newline: bool = True) -> None:
    """Print on standard error, if that is possible."""
    click.echo(text, file=tolerant_stderr(), nl=newline)


def tolerant_stderr() -> Any:
    """Return standard error as a stream, for click, that drops what cannot be printed."""
    return _TolerantStream(sys.stderr)


def is_json_output() -> bool:
    """Whether the command that runs was asked to answer a program."""
    return bool(click.get_current_context().params["as_json"])


def is_interactive() -> bool:
    """Whether progress on stderr is seen by someone: a terminal, and no --json."""
    return tolerant_stderr().isatty() and not is_json_output()


@contextmanager
def progress_bar(length: int, label: str) -> Iterator[Callable[[str], None]]:
    """Yield what to call with a few words at each of length steps; a bar on stderr shows them."""
    shown: Any = click.progressbar(
        length=length,
        label=label,
        file=tolerant_stderr(),
        show_eta=False,
        show_percent=False,
        show_pos=True,
        item_show_func=lambda words: words or "",
    )
    with shown as bar:
        yield lambda words: bar.update(1, words)


def discard_unprinted_text() -> None:
    """Send text that could not be printed to the null device; Python would print it again at its end."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except (OSError, ValueError):
            redirect_to_null(stream)


def redirect_to_null(stream: TextIO) -> None:
    """Let a stream write to the null device, what it still holds too; also when its reader does not read."""
    with suppress(OSError, ValueError):
        null_device = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null_device, stream.fileno())
        os.close(null_device)


def open_closed_streams() -> None:
    """Where a standard stream is closed, put one in its place that cannot be written to.

    Otherwise the next file that is opened would get its number, and hold what C libraries print on standard
    error; and text for standard output would be dropped without a failure.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)  # the lowest free number, which is this one
            if name != "stdin":
                setattr(sys, name, os.fdopen(descriptor, "w", closefd=False))


class _TolerantStream:
    """A stream for `click` that drops what cannot be written; None, for a closed one, takes nothing."""

    def __init__(self, stream: TextIO | None) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        with suppress(OSError, ValueError):
            if self.stream is not None:
                self.stream.write(_encodable(text, self.stream))
        return len(text)

    def flush(self) -> None:
        with suppress(OSError, ValueError):
            if self.stream is not None:
                self.stream.flush()

    def isatty(self) -> bool:
        try:
            return self.stream is not None and self.stream.isatty()
        except (OSError, ValueError):
            return False


def _encodable(text: str, stream: TextIO) -> str:
    """The text with what the stream's encoding lacks written as backslash escapes."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        text.encode(encoding, getattr(stream, "errors", None) or "strict")
    except UnicodeEncodeError:
        return text.encode(encoding, "backslashreplace").decode(encoding)
    return text


def _wait_for_reader(stream: TextIO, should_stop: Callable[[], object]) -> None:
    """Return once a pipe or terminal takes text.    Raises: OSError, when stopped before that."""
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError):  # no real file: it never waits
        return
    while not select.select([], [descriptor], [], WAIT_INTERVAL)[1]:
        if should_stop():
            raise OSError(EAGAIN, "nothing reads it")
