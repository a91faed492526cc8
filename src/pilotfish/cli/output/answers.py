"""How every command answers: text for people or one JSON object, and a refusal in one line."""

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

from pilotfish.cli.output.terminal import print_failure, print_line
from pilotfish.cli.stream.signals import SIGNAL_EXIT_OFFSET
from pilotfish.errors import InvalidInput, SkillError, escape
from pilotfish.io import is_folder, is_link, path_exists, require_replaceable, resolve_path


@dataclass(frozen=True, slots=True)
class CommandResult:
    """What a command found out, twice: for people, and for programs. code is the exit code."""

    text: str
    data: dict[str, Any]
    exit_code: int = 0


def print_result(run: Callable[..., CommandResult]) -> Callable[..., None]:
    """A command that prints the answer of work; a refusal of ours is one line on stderr and exit code 1.

    The work writes its files before it returns, so an answer that cannot be printed costs none of them; the
    exit code is then 1, with a line on stderr unless the reader of a pipe went away, as `head` does. Misuse
    (click.UsageError) has exit code 2. A bug keeps its traceback.
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
        elif result.text:  # demo has said it all by then
            print_line(result.text, should_stop)
        _exit_with_code(result.exit_code)

    return command


def example_epilog(*lines: str) -> str:
    """The end of a command's help: what one might type."""
    return "\n".join(["\b", "Example:", *(f"  {line}" for line in lines)])


def require_finite_option(_: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    """What a range lets through: nan, and inf where it has no end.    Raises: click.BadParameter."""
    if value is not None and not isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.", param=parameter)
    return value


def require_writable_file(*outputs: Path | None, force: bool, inputs: Iterable[Path | None] = ()) -> None:
    """Return if each output can be written: its folder is there and the output is not, unless force is given.

    To be asked before the work. What writes the output refuses to replace one that appears later.

    Raises:
        click.UsageError: If a file is to be two outputs, or an input and an output, force or not.
        InvalidInput: If an output cannot be written.
    """
    written = [path for path in outputs if path is not None]
    _require_distinct_files(written, [path for path in inputs if path is not None])
    for path in written:
        _require_writable_parent(path)
        if is_folder(path):
            raise InvalidInput(f"{path} is a folder; give the name of a file")
        if not force and (path_exists(path) or is_link(path)):
            raise InvalidInput(f"{path} exists; choose another name, or replace it with --force")


def require_writable_folder(path: Path, *, force: bool) -> None:
    """Return if demonstrations can be written to a folder: it is missing or empty, or force replaces others.

    Raises:
        InvalidInput: If they cannot.
    """
    _require_writable_parent(path)
    exists = path_exists(path) or is_link(path)
    try:
        require_replaceable(path, overwrite=force)
    except InvalidInput as error:
        if force or not exists:
            raise
        raise InvalidInput(f"{path} exists; choose another name, or replace it with --force") from error


def write_all(*writes: Callable[[], object]) -> None:
    """Write several outputs, each also when another fails.

    Raises:
        SkillError: The failure, or InvalidInput with all of them.
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
    """Raise InvalidInput unless the folder that path is to be in can be written to."""
    if not is_folder(path.parent):
        raise InvalidInput(f"{path} cannot be written: {path.parent} is no folder; make it first")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise InvalidInput(f"{path} cannot be written: no permission to write in {path.parent}")


def _exit_with_code(exit_code: int) -> None:
    """End the command: with its own exit code, or with 1 when its answer could not be printed."""
    context = click.get_current_context()
    error = print_failure()
    if exit_code:
        context.exit(exit_code)
    if error is None:
        return
    if isinstance(error, OSError) and error.errno == EPIPE:
        context.exit(1)
    reason = (error.strerror if isinstance(error, OSError) else None) or error
    raise click.ClickException(f"the answer cannot be printed: {reason}; all files are written")


def _require_distinct_files(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """A file is one, whatever path leads to it."""
    read = {resolve_path(path) for path in inputs}
    written: set[Path] = set()
    for path in outputs:
        if (file := resolve_path(path)) in read:
            raise click.UsageError(f"{path} is what this command reads; choose another name for the output")
        if file in written:
            raise click.UsageError(f"{path} is named for two outputs; choose another name for one")
        written.add(file)


def format_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns side by side, two blanks apart."""
    cells = [[escape(cell) for cell in row] for row in (header, *rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(header))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in cells)
    return "\n".join(line.rstrip() for line in lines)


def format_key_values(rows: Sequence[tuple[str, str]]) -> str:
    """What and how much, a line each."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name.ljust(width)}  {escape(value)}" for name, value in rows)
