"""Results of commands: text for people or one JSON object, errors in one line, and checks of output paths."""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from errno import EPIPE
from functools import wraps
from math import isfinite
from pathlib import Path
from typing import Any

import click

from pilotfish.cli.output.tables import Table
from pilotfish.cli.output.terminal import print_failure, print_line, terminal_width
from pilotfish.cli.stream.signals import SIGNAL_EXIT_OFFSET
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import is_folder, path_exists, require_replaceable, resolve_path


@dataclass(frozen=True, slots=True)
class CommandResult:
    """Result of a command, for people and for programs.

    Attributes:
        blocks: Paragraphs and tables for people; a blank line separates them.
        data: JSON object for programs.
        exit_code: Exit code of the command.
    """

    blocks: Sequence[str | Table]
    data: dict[str, Any]
    exit_code: int = 0

    def to_text(self, width: int | None = None) -> str:
        """Return the blocks as text; width is that of a terminal, None for plain text."""
        return "\n\n".join(b.to_text(width) if isinstance(b, Table) else b for b in self.blocks)


def print_result(run: Callable[..., CommandResult]) -> Callable[..., None]:
    """Turn a function that returns a CommandResult into a command that prints it.

    A SkillError becomes one line on stderr and exit code 1; a click.UsageError has exit code 2. Any other
    exception keeps its traceback. The function writes its files before it returns, so a result that cannot
    be printed loses no file. The exit code is then 1, with a line on stderr, unless the reader closed its
    pipe, as `head` does.

    Args:
        run: Function of the options of the command.

    Returns:
        The function with an additional option, --json.
    """

    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
    @wraps(run)
    def command(*, as_json: bool, **options: Any) -> None:
        try:
            result = run(**options)
        except SkillError as error:
            raise click.ClickException(" ".join(str(error).split())) from error
        should_stop = (lambda: True) if result.exit_code > SIGNAL_EXIT_OFFSET else None
        if as_json:
            print_line(json.dumps(result.data, allow_nan=False), should_stop)
        elif result.blocks:
            print_line(result.to_text(terminal_width()), should_stop)
        _exit_with_code(result.exit_code)

    return command


def example_epilog(*lines: str) -> str:
    """Return the end of a help text: example command lines."""
    return "\n".join(["\b", "Example:", *(f"  {line}" for line in lines)])


def require_finite_option(_: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    """Return the value of an option, or raise click.BadParameter if it is infinite or nan.

    A click.FloatRange accepts nan, and inf where it has no upper limit.
    """
    if value is not None and not isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.", param=parameter)
    return value


def require_writable_file(*outputs: Path | None, force: bool, inputs: Iterable[Path | None] = ()) -> None:
    """Check, before the work begins, that each output can be written.

    The function that writes an output refuses to replace a file that appears later.

    Args:
        outputs: Files to write; None for an option that was not given.
        force: Whether existing files may be replaced.
        inputs: Files that the command reads.

    Raises:
        click.UsageError: If one file is named for two outputs, or is both an input and an output.
        InvalidInput: If the folder of an output is missing, or the output exists and force is False.
    """
    written = [path for path in outputs if path is not None]
    _require_distinct_files(written, [path for path in inputs if path is not None])
    for path in written:
        _require_writable_parent(path)
        if is_folder(path):
            raise InvalidInput(f"{path} is a folder, expected a file name; append a name, such as {path}/out")
        if not force and path_exists(path, follow_links=False):
            raise InvalidInput(f"{path} exists; choose another name, or replace it with --force")


def require_writable_folder(path: Path, *, force: bool) -> None:
    """Check that demonstrations can be written to a folder that is missing or empty.

    Args:
        path: Folder to write.
        force: Whether a folder of demonstrations may be replaced.

    Raises:
        InvalidInput: If the folder cannot be written or must not be replaced.
    """
    _require_writable_parent(path)
    exists = path_exists(path, follow_links=False)
    try:
        require_replaceable(path, overwrite=force)
    except InvalidInput as error:
        if force or not exists:
            raise
        raise InvalidInput(f"{path} exists; choose another name, or replace it with --force") from error


def write_all(*writes: Callable[[], object]) -> None:
    """Call every function, also after one has failed.

    Args:
        writes: Functions that write one output each.

    Raises:
        SkillError: The failure if one function failed; InvalidInput with all messages if several did.
    """
    failures: list[SkillError] = []
    for write in writes:
        try:
            write()
        except SkillError as error:
            failures.append(error)
    if len(failures) == 1:
        raise failures[0]
    if failures:
        raise InvalidInput("; ".join(map(str, failures))) from failures[0]


def _require_writable_parent(path: Path) -> None:
    if not is_folder(path.parent):
        raise InvalidInput(f"{path} cannot be written: {path.parent} is not a folder; create it first")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InvalidInput(f"{path} cannot be written: no permission to write in {path.parent}")


def _exit_with_code(exit_code: int) -> None:
    """End the command with its exit code, or with 1 if its result could not be printed."""
    context = click.get_current_context()
    error = print_failure()
    if exit_code:
        context.exit(exit_code)
    if error is None:
        return
    if isinstance(error, OSError) and error.errno == EPIPE:
        context.exit(1)
    reason = (error.strerror if isinstance(error, OSError) else None) or error
    raise click.ClickException(f"the result cannot be printed: {reason}; all files are written")


def _require_distinct_files(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """Compare resolved paths: different paths may lead to one file."""
    read = {resolve_path(path) for path in inputs}
    written: set[Path] = set()
    for path in outputs:
        if (file := resolve_path(path)) in read:
            raise click.UsageError(f"{path} is an input of this command; choose another name for the output")
        if file in written:
            raise click.UsageError(f"{path} is named for two outputs; choose another name for one")
        written.add(file)
