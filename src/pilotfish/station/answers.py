"""How every command answers: text for people or one JSON object, and a refusal in one line."""

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import wraps
from math import isfinite
from pathlib import Path
from typing import Any

import click

from pilotfish.errors import InvalidInput, SkillError


@dataclass(frozen=True, slots=True)
class Answer:
    """What a command found out, twice: for people, and for programs. code is the exit code."""

    text: str
    facts: dict[str, Any]
    code: int = 0


def answering(work: Callable[..., Answer]) -> Callable[..., None]:
    """A command that prints the answer of work; a refusal of ours is one line on stderr and exit code 1.

    Misuse (click.UsageError) is told by click, with exit code 2. A bug keeps its traceback.
    """

    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
    @wraps(work)
    def command(*, as_json: bool, **chosen: Any) -> None:
        try:
            answer = work(**chosen)
        except SkillError as error:
            raise click.ClickException(" ".join(str(error).split())) from error
        if as_json:
            click.echo(json.dumps(answer.facts, allow_nan=False))
        elif answer.text:  # demo has said it all by then
            click.echo(answer.text)
        if answer.code:
            click.get_current_context().exit(answer.code)

    return command


def example(*lines: str) -> str:
    """The end of a command's help: what one might type."""
    return "\n".join(["\b", "Example:", *(f"  {line}" for line in lines)])


def as_json() -> bool:
    """Whether the command that runs was asked to answer a program."""
    return bool(click.get_current_context().params["as_json"])


def a_person_watches() -> bool:
    """Whether progress on stderr is seen by someone: a terminal, and no --json."""
    return sys.stderr.isatty() and not as_json()


def remark(text: str) -> None:
    """A line on stderr, out of the way of the answer."""
    if not as_json():
        click.echo(text, err=True)


def finite(_: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    """What a range lets through: nan, and inf where it has no end.    Raises: click.BadParameter."""
    if value is not None and not isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.", param=parameter)
    return value


def require_new(*outputs: Path | None, force: bool, inputs: Iterable[Path | None] = ()) -> None:
    """Each output's folder is there and the output is not, unless force allows to replace it.

    Raises: click.UsageError, when a file is to be two outputs, or an input and an output, force or not;
    InvalidInput. To be asked before the work, not after it.
    """
    written = [path for path in outputs if path is not None]
    _refuse_twins(written, [path for path in inputs if path is not None])
    for path in written:
        if not path.parent.is_dir():
            raise InvalidInput(f"{path} cannot be written: {path.parent} is no folder; make it first")
        if path.is_dir():
            raise InvalidInput(f"{path} is a folder; give the name of a file")
        if path.exists() and not force:
            raise InvalidInput(f"{path} exists; choose another name, or replace it with --force")


def _refuse_twins(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """A file is one, whatever path leads to it."""
    read = {path.resolve() for path in inputs}
    written: set[Path] = set()
    for path in outputs:
        if (file := path.resolve()) in read:
            raise click.UsageError(f"{path} is what this command reads; choose another name for the output")
        if file in written:
            raise click.UsageError(f"{path} is named for two outputs; choose another name for one")
        written.add(file)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns side by side, two blanks apart."""
    cells = [list(header), *map(list, rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(header))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in cells)
    return "\n".join(line.rstrip() for line in lines)


def plain_table(rows: Sequence[tuple[str, str]]) -> str:
    """What and how much, a line each."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name.ljust(width)}  {value}" for name, value in rows)
