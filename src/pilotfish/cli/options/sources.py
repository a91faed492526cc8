"""Where a command takes its recordings from: a folder, or a data set by name."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from pilotfish.demonstrations import Demonstration, add_derivatives, to_sphere
from pilotfish.errors import InvalidInput
from pilotfish.io import datasets, read_demonstrations, synthetic_valve
from pilotfish.models import Skill
from pilotfish.validation import first_duplicate, nearest_name, short_list, short_repr

NUMBER = re.compile("[0-9]{1,6}")
DATASET_PREFIX = "dataset:"
SYNTHETIC_NAME = "synthetic valve"  # the stand-in that needs no download


def load_demonstrations(source: str) -> tuple[Demonstration, ...]:
    """The demonstrations of a folder, or those of dataset:NAME.    Raises: SkillError."""
    if source.startswith(DATASET_PREFIX):
        return load_dataset(source.removeprefix(DATASET_PREFIX))
    return read_demonstrations(source)


def recording_files(folder: Path) -> list[Path]:
    """What may be a recording or say what recordings mean, and so must not become a skill."""
    try:
        return [path for path in folder.iterdir() if path.suffix in (".csv", ".npz", ".toml", ".json")]
    except OSError:  # no folder, or one that cannot be read: reading the recordings says what is wrong
        return []


def load_dataset(name: str) -> tuple[Demonstration, ...]:
    """A published recording, or the generated valve, by the name that `pilotfish data list` shows.

    Raises: InvalidInput, when there is none; SkillError, when it cannot be downloaded.
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
    """Raises: InvalidInput, with all that there are and the nearest, when no data set has that name."""
    known = (*datasets.names(), SYNTHETIC_NAME)
    if name in known:
        return
    nearest = nearest_name(name, known)
    hint = f"; did you mean {nearest!r}?" if nearest else ""
    raise InvalidInput(f"no data set is named {short_repr(name)}, there are {', '.join(known)}{hint}")


def validate_selection(_: click.Context, parameter: click.Parameter, only: str) -> str:
    """A list of numbers such as 0-3 or 0,2,5-7, or none.    Raises: click.BadParameter."""
    try:
        if only:
            _parse_ranges(only)
    except InvalidInput as error:
        raise click.BadParameter(str(error), param=parameter) from error
    return only


def select_demonstrations(demonstrations: Sequence[Demonstration], only: str) -> tuple[Demonstration, ...]:
    """Those that only names, such as 0-3 or 0,2,5-7, in that order; all, when it names none.

    Raises: InvalidInput, when it names one that is not there or one twice, or is no list of numbers.
    """
    if not only:
        return tuple(demonstrations)
    listed, last = _parse_ranges(only), len(demonstrations) - 1
    if bad := [numbers for numbers in listed if numbers[-1] > last]:
        first = max(bad[0][0], last + 1)
        raise InvalidInput(f"--only {short_repr(only)} names demonstration {first}, there are 0 to {last}")
    numbers = [n for piece in listed for n in piece]
    if (repeated := first_duplicate(numbers)) is not None:
        raise InvalidInput(f"--only {short_repr(only)} names demonstration {repeated} more than once")
    return tuple(demonstrations[n] for n in numbers)


def add_velocities(demonstrations: Sequence[Demonstration]) -> tuple[Demonstration, ...]:
    """The demonstrations with the speed of every column, where the recording has none."""
    return tuple(
        demo if any(part.derivative for part in demo.layout.parts) else add_derivatives(demo)
        for demo in demonstrations
    )


def prepare_demonstrations(
    demonstrations: Sequence[Demonstration], *, riemannian: bool, velocities: bool
) -> tuple[Demonstration, ...]:
    """With orientations on S^3 if so wished, and with the speed of every column where there is none."""
    converted = tuple(to_sphere(demo) if riemannian else demo for demo in demonstrations)
    return add_velocities(converted) if velocities else converted


def training_demonstrations(skill: Skill, source: str) -> tuple[Demonstration, ...]:
    """The recordings that a skill was learned from, in its columns and with its frames.

    Of a skill that names none, one that was learned from a stream, they are all that are there.
    Raises: SkillError, when one is not among those of the folder or data set.
    """
    available = {demo.name: demo for demo in load_demonstrations(source)}
    names = skill.provenance.demonstrations or tuple(available)
    if missing := [name for name in names if name not in available]:
        raise InvalidInput(
            f"{source} has the recordings {short_list(list(available))}, and the skill was learned from "
            f"{missing[0]!r} too; name the folder that it was learned from"
        )
    return tuple(_match_columns(skill, available[name]) for name in names)


def _match_columns(skill: Skill, demo: Demonstration) -> Demonstration:
    velocities = any(part.derivative for part in skill.layout.parts)
    here = prepare_demonstrations(
        (demo,), riemannian=bool(skill.layout.orientation_starts), velocities=velocities
    )[0]
    return replace(here, frames=tuple(f for f in here.frames if f.name in skill.frame_names))


def _parse_ranges(only: str) -> list[range]:
    return [_parse_range(piece, only) for piece in only.split(",")]


def _parse_range(piece: str, only: str) -> range:
    ends = [end.strip() for end in piece.split("-")]
    if len(ends) > 2 or not all(NUMBER.fullmatch(end) for end in ends):
        raise InvalidInput(
            f"--only is {short_repr(only)}, expected numbers such as 0-3 or 0,2,5 (first is 0)"
        )
    first, last = int(ends[0]), int(ends[-1])
    if last < first:
        raise InvalidInput(
            f"--only is {short_repr(only)}: {piece.strip()} runs backwards; say {last}-{first}"
        )
    return range(first, last + 1)
