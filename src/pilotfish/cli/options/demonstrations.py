"""Demonstrations of a command: a folder or a data set, a selection of it, and added velocities."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.demonstrations import Demonstration, add_derivatives, to_sphere
from pilotfish.errors import InvalidInput
from pilotfish.io import (
    MAX_GROUP,
    datasets,
    is_folder,
    is_lerobot,
    list_groups,
    read_demonstrations,
    read_group,
    synthetic_valve,
)
from pilotfish.models import Skill
from pilotfish.validation import first_duplicate, nearest_name, short_list, short_repr

Command = Callable[..., Any]
NUMBER = re.compile("[0-9]{1,6}")
DATASET_PREFIX = "dataset:"
SYNTHETIC_NAME = "synthetic valve"  # generated demonstrations, which need no download
# Fixes in messages of `read_demonstrations`, and what to type instead.
COMMAND_FIXES = {
    "pass unwrap_orientations(x, layout)": "pilotfish data import {source} --out NEW makes them continuous",
    "resample the recording with build_demonstration": "resample: pilotfish data import {source} --out NEW",
    "convert recordings with io.readers and build_demonstration, or write a template with "
    "io.write_folder_template": "pilotfish data import {source} --out NEW converts recordings, "
    "pilotfish data init NEW writes a template",
}
DEMONSTRATION_SUFFIXES = (".csv", ".npz", ".toml", ".json")


def load_demonstrations(source: str) -> tuple[Demonstration, ...]:
    """Load the demonstrations of a folder, of a LeRobot data set, or of dataset:NAME.

    Raises:
        SkillError: If they cannot be read or downloaded.
    """
    if source.startswith(DATASET_PREFIX):
        return load_dataset(source.removeprefix(DATASET_PREFIX))
    if is_lerobot(source):
        (group,) = list_groups(source, MAX_GROUP)
        return read_group(group)
    try:
        return read_demonstrations(source)
    except InvalidInput as error:
        raise InvalidInput(_with_command_fix(str(error), source)) from error


def _with_command_fix(message: str, source: str) -> str:
    """Return a message with the command that does what a function in Python is named for."""
    for function, fix in COMMAND_FIXES.items():
        message = message.replace(function, fix.format(source=source))
    names = (*datasets.names(), SYNTHETIC_NAME)
    if source in names and not is_folder(source):
        message += f"; did you mean the data set {DATASET_PREFIX}{source}?"
    return message


def demonstration_files(folder: Path) -> list[Path]:
    """Return the files of a folder that may belong to its demonstrations; no output may replace them."""
    try:
        return [path for path in folder.iterdir() if path.suffix in DEMONSTRATION_SUFFIXES]
    except OSError:  # missing or unreadable: reading the demonstrations reports it
        return []


def load_dataset(name: str) -> tuple[Demonstration, ...]:
    """Load a data set by a name that `pilotfish data list` prints.

    Raises:
        InvalidInput: If no data set has this name.
        SkillError: If it cannot be downloaded.
    """
    if name == SYNTHETIC_NAME:
        return synthetic_valve(np.random.default_rng(0))
    require_dataset(name)
    readers: dict[str, Callable[..., tuple[Demonstration, ...]]] = {
        "valve": datasets.valve,
        "zshape": datasets.zshape,
        "robotasks": datasets.robotasks,
        "helloworld": datasets.helloworld,
        "chicken_dance": datasets.chicken_dance,
        "mocap6": datasets.mocap6,
        "letters": datasets.letters,
    }
    first, *rest = name.split()
    return readers[first](*rest)


def require_dataset(name: str) -> None:
    """Raise InvalidInput, with all names and the nearest one, unless a data set has this name."""
    known = (*datasets.names(), SYNTHETIC_NAME)
    if name in known:
        return
    nearest = nearest_name(name, known)
    hint = f"; did you mean {nearest!r}?" if nearest else ""
    raise InvalidInput(f"data set {short_repr(name)} is unknown, expected one of {', '.join(known)}{hint}")


def only_option(command: Command) -> Command:
    """Add --only, which selects demonstrations, to a command."""
    return click.option(
        "--only",
        default="",
        metavar="LIST",
        callback=validate_selection,
        help="Demonstrations to use, counted from 0, such as 0-3 or 0,2,5-7.  [default: all]",
    )(command)


def riemannian_option(command: Command) -> Command:
    """Add --riemannian/--euclidean to a command."""
    return click.option(
        "--riemannian/--euclidean",
        default=False,
        show_default=True,
        help="Treat unit quaternions as orientations on S^3, or as four independent numbers.",
    )(command)


def validate_selection(_: click.Context, parameter: click.Parameter, only: str) -> str:
    """Return a list of numbers such as 0-3 or 0,2,5-7, or raise click.BadParameter."""
    try:
        if only:
            _parse_ranges(only)
    except InvalidInput as error:
        raise click.BadParameter(str(error), param=parameter) from error
    return only


def select_demonstrations(demonstrations: Sequence[Demonstration], only: str) -> tuple[Demonstration, ...]:
    """Select demonstrations by a list of numbers, in the order of the list.

    Args:
        demonstrations: Demonstrations to select from.
        only: List such as 0-3 or 0,2,5-7; empty selects all.

    Returns:
        The selected demonstrations.

    Raises:
        InvalidInput: If a number is out of range or repeated, or the list cannot be parsed.
    """
    if not only:
        return tuple(demonstrations)
    ranges, last = _parse_ranges(only), len(demonstrations) - 1
    if bad := [numbers for numbers in ranges if numbers[-1] > last]:
        first = max(bad[0][0], last + 1)
        raise InvalidInput(f"--only {short_repr(only)} has demonstration {first}, expected 0 to {last}")
    numbers = [n for piece in ranges for n in piece]
    if (repeated := first_duplicate(numbers)) is not None:
        raise InvalidInput(
            f"--only {short_repr(only)} has demonstration {repeated} more than once; give each number once"
        )
    return tuple(demonstrations[n] for n in numbers)


def prepare_demonstrations(
    demonstrations: Sequence[Demonstration], *, riemannian: bool, velocities: bool
) -> tuple[Demonstration, ...]:
    """Prepare demonstrations for learning.

    Args:
        demonstrations: Demonstrations as they were read.
        riemannian: Whether unit quaternions become orientations on S^3.
        velocities: Whether time derivatives are added where a demonstration has none.

    Returns:
        The demonstrations in the columns to learn.
    """
    converted = tuple(to_sphere(demo) if riemannian else demo for demo in demonstrations)
    return tuple(
        add_derivatives(demo)
        if velocities and not any(part.derivative for part in demo.layout.parts)
        else demo
        for demo in converted
    )


def training_demonstrations(skill: Skill, source: str) -> tuple[Demonstration, ...]:
    """Load the demonstrations that a skill was learned from, with its columns and frames.

    Args:
        skill: Learned skill. If it names no demonstrations, as after a stream, all of the source are used.
        source: Folder, or dataset:NAME.

    Returns:
        The demonstrations in the order in which the skill names them.

    Raises:
        SkillError: If one of them is missing from the source.
    """
    available = {demo.name: demo for demo in load_demonstrations(source)}
    names = skill.provenance.demonstrations or tuple(available)
    if missing := [name for name in names if name not in available]:
        raise InvalidInput(
            f"{source} has the demonstrations {short_list(list(available))}, but the skill was also learned "
            f"from {missing[0]!r}; name the folder that the skill was learned from"
        )
    return tuple(match_skill(available[name], skill) for name in names)


def match_skill(demo: Demonstration, skill: Skill) -> Demonstration:
    """Return a demonstration with the columns and the frames of a skill, as far as it has them."""
    velocities = any(part.derivative for part in skill.layout.parts)
    riemannian = bool(skill.layout.orientation_starts)
    (prepared,) = prepare_demonstrations((demo,), riemannian=riemannian, velocities=velocities)
    return replace(prepared, frames=tuple(f for f in prepared.frames if f.name in skill.frame_names))


def _parse_ranges(only: str) -> list[range]:
    return [_parse_range(piece, only) for piece in only.split(",")]


def _parse_range(piece: str, only: str) -> range:
    ends = [end.strip() for end in piece.split("-")]
    if len(ends) > 2 or not all(NUMBER.fullmatch(end) for end in ends):
        raise InvalidInput(
            f"--only is {short_repr(only)}, expected numbers counted from 0, such as 0-3 or 0,2,5"
        )
    first, last = int(ends[0]), int(ends[-1])
    if last < first:
        raise InvalidInput(f"--only is {short_repr(only)}, but {piece.strip()} decreases; use {last}-{first}")
    return range(first, last + 1)
