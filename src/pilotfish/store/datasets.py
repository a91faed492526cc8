"""Public recordings by name: `datasets.valve()`.

Each is read from the folder that the environment variable PILOTFISH_DATA names (valve/BaxterValveDemos2.mat
...), or else downloaded once into the user's cache; its sha256 is checked either way.
"""

import difflib

from pilotfish.demonstrations import (
    Demonstration,
    read_helloworld_npy,
    read_robotasks_npy,
    read_valve_mat,
    read_zshape_mat,
)
from pilotfish.errors import InvalidInput
from pilotfish.store.datasets_files import file_of
from pilotfish.store.datasets_registry import DATASETS, Dataset

__all__ = ["Dataset", "helloworld", "info", "names", "robotasks", "valve", "zshape"]


def names() -> tuple[str, ...]:
    """What `info` knows; "robotasks openbox" is read by robotasks("openbox")."""
    return tuple(dataset.name for dataset in DATASETS)


def info(name: str) -> Dataset:
    """Address, sha256, licence and citation of a dataset.

    Raises: InvalidInput, when there is none of that name.
    """
    for dataset in DATASETS:
        if dataset.name == name:
            return dataset
    near = difflib.get_close_matches(name, names(), n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise InvalidInput(f"no dataset is named {name!r}, there are {', '.join(names())}{hint}")


def valve() -> tuple[Demonstration, ...]:
    """Eight openings of a valve by a Baxter arm, seen from the valve before and after.

    The first four are to learn from, the last four to test with.
    Raises: SkillError, when the file is neither here nor to be had.
    """
    return read_valve_mat(file_of(info("valve")))


def zshape() -> tuple[Demonstration, ...]:
    """Five Z-shaped movements in space.

    Raises: SkillError, when the file is neither here nor to be had.
    """
    return read_zshape_mat(file_of(info("zshape")))


def robotasks(task: str) -> tuple[Demonstration, ...]:
    """Nine showings of a household task with a Franka arm.

    Tasks: openbox, bottle2shelf, platestandingtolying, pouring.

    Raises: InvalidInput, for another task; SkillError, when the file is neither here nor to be had.
    """
    return read_robotasks_npy(file_of(info(f"robotasks {task}")))


def helloworld(letter: str) -> tuple[Demonstration, ...]:
    """A letter (e, h, l or o) written on a table by hand-guiding a Franka arm, eight times.

    Raises: InvalidInput, for another letter; SkillError, when the file is neither here nor to be had.
    """
    return read_helloworld_npy(file_of(info(f"helloworld {letter}")))
