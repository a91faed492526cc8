"""Public recordings by name: `datasets.valve()`.

Each is read from the folder that the environment variable PILOTFISH_DATA names (valve/BaxterValveDemos2.mat
...), or else downloaded once into the user's cache; its sha256 is checked either way.
"""

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.datasets_files import dataset_path
from pilotfish.io.datasets_registry import DATASETS, Dataset
from pilotfish.io.published_archives import (
    read_chicken_dance_npz,
    read_letters_npz,
    read_mocap6_labels_npz,
    read_mocap6_npz,
)
from pilotfish.io.published_arrays import read_helloworld_npy, read_robotasks_npy
from pilotfish.io.published_matlab import read_valve_mat, read_zshape_mat
from pilotfish.types import Array, Int
from pilotfish.validation import nearest_name, short_repr

__all__ = [
    "Dataset",
    "chicken_dance",
    "helloworld",
    "info",
    "letters",
    "mocap6",
    "mocap6_labels",
    "names",
    "robotasks",
    "valve",
    "zshape",
]


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
    near = nearest_name(name, names())
    hint = f"; did you mean {near!r}?" if near else ""
    raise InvalidInput(f"no dataset is named {short_repr(name)}, there are {', '.join(names())}{hint}")


def valve() -> tuple[Demonstration, ...]:
    """Eight openings of a valve by a Baxter arm, seen from the valve before and after.

    The first four are to learn from, the last four to test with.
    Raises: SkillError, when the file is neither here nor to be had.
    """
    return read_valve_mat(dataset_path(info("valve")))


def zshape() -> tuple[Demonstration, ...]:
    """Five Z-shaped movements in space.

    Raises: SkillError, when the file is neither here nor to be had.
    """
    return read_zshape_mat(dataset_path(info("zshape")))


def robotasks(task: str) -> tuple[Demonstration, ...]:
    """Nine showings of a household task with a Franka arm.

    Tasks: openbox, bottle2shelf, platestandingtolying, pouring.

    Raises: InvalidInput, for another task; SkillError, when the file is neither here nor to be had.
    """
    return read_robotasks_npy(dataset_path(info(f"robotasks {task}")))


def helloworld(letter: str) -> tuple[Demonstration, ...]:
    """A letter (e, h, l or o) written on a table by hand-guiding a Franka arm, eight times.

    Raises: InvalidInput, for another letter; SkillError, when the file is neither here nor to be had.
    """
    return read_helloworld_npy(dataset_path(info(f"helloworld {letter}")))


def chicken_dance() -> tuple[Demonstration, ...]:
    """One person's chicken dance: the positions of 28 nodes of the body, 12.8 s at 120 Hz.

    Raises: SkillError, when the file is not here: it is an extract and is not downloaded.
    """
    return read_chicken_dance_npz(dataset_path(info("chicken_dance")))


def mocap6() -> tuple[Demonstration, ...]:
    """Four sequences of exercises: height of the hips and eleven joint angles, 20 to 45 s at 10 Hz.

    Raises: SkillError, when the file is not here: it is an extract and is not downloaded.
    """
    return read_mocap6_npz(dataset_path(info("mocap6")))


def mocap6_labels() -> tuple[Int[Array, " _"], ...]:
    """Which exercise, a number from 1 to 12, a person saw at every step of each sequence of mocap6.

    Raises: SkillError, when the file is not here: it is an extract and is not downloaded.
    """
    return read_mocap6_labels_npz(dataset_path(info("mocap6")))


def letters() -> tuple[Demonstration, ...]:
    """Letters by a pen on a tablet, five each of a, b, c, d, e and m, in that order: velocity and force.

    Raises: SkillError, when the file is not here: it is an extract and is not downloaded.
    """
    return read_letters_npz(dataset_path(info("letters")))
