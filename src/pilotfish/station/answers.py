"""How every command answers: text for people or one JSON object, and a refusal in one line."""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
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

    A bug keeps its traceback.
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


def require_new(*outputs: Path | None, force: bool) -> None:
    """Each output's folder is there and the output is not, unless force allows to replace it.

    Raises: InvalidInput. To be asked before the work, not after it.
    """
    for path in outputs:
        if path is None:
            continue
        if not path.parent.is_dir():
            raise InvalidInput(f"{path} cannot be written: {path.parent} is no folder; make it first")
        if path.is_dir():
            raise InvalidInput(f"{path} is a folder; give the name of a file")
        if path.exists() and not force:
            raise InvalidInput(f"{path} exists; choose another name, or replace it with --force")


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
