"""Public recordings by name, such as `datasets.valve()`.

Each is read from the folder in the environment variable PILOTFISH_DATA (valve/BaxterValveDemos2.mat ...), or
downloaded once into the user's cache. Its SHA-256 is checked in both cases. The readers, such as
`datasets.read_valve_mat(path)`, read a file of the same format from any place.
"""

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.dataset_files import dataset_path
from pilotfish.io.dataset_registry import DATASETS, Dataset
from pilotfish.io.published_matlab import read_valve_mat, read_zshape_mat
from pilotfish.io.published_npy import read_helloworld_npy, read_robotasks_npy
from pilotfish.io.published_npz import (
    read_chicken_dance_npz,
    read_letters_npz,
    read_mocap6_labels_npz,
    read_mocap6_npz,
)
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
    "read_chicken_dance_npz",
    "read_helloworld_npy",
    "read_letters_npz",
    "read_mocap6_labels_npz",
    "read_mocap6_npz",
    "read_robotasks_npy",
    "read_valve_mat",
    "read_zshape_mat",
    "robotasks",
    "valve",
    "zshape",
]


def names() -> tuple[str, ...]:
    """Return the names that `info` accepts; "robotasks openbox" is read by robotasks("openbox")."""
    return tuple(dataset.name for dataset in DATASETS)


def info(name: str) -> Dataset:
    """Return address, checksum, licence and citation of a data set.

    Args:
        name: One of `names()`.

    Raises:
        InvalidInput: If no data set has that name.
    """
    for dataset in DATASETS:
        if dataset.name == name:
            return dataset
    nearest = nearest_name(name, names())
    hint = f"; did you mean {nearest!r}?" if nearest else ""
    raise InvalidInput(f"no data set is named {short_repr(name)}, there are {', '.join(names())}{hint}")


def valve() -> tuple[Demonstration, ...]:
    """Return eight openings of a valve by a Baxter arm, with frames of the valve before and after.

    The first four are for training, the last four for testing.

    Raises:
        SkillError: If the file is missing and cannot be downloaded.

    Source:
        Tanwani & Calinon 2016, IEEE RA-L 1(1).
    """
    return read_valve_mat(dataset_path(info("valve")))


def zshape() -> tuple[Demonstration, ...]:
    """Return five Z-shaped movements in space.

    Raises:
        SkillError: If the file is missing and cannot be downloaded.

    Source:
        Tanwani & Calinon 2016, IEEE RA-L 1(1).
    """
    return read_zshape_mat(dataset_path(info("zshape")))


def robotasks(task: str) -> tuple[Demonstration, ...]:
    """Return nine demonstrations of a household task with a Franka arm.

    Args:
        task: openbox, bottle2shelf, platestandingtolying or pouring.

    Raises:
        InvalidInput: If task is another one.
        SkillError: If the file is missing and cannot be downloaded.

    Source:
        Auddy et al. 2023, Robotics and Autonomous Systems 165.
    """
    return read_robotasks_npy(dataset_path(info(f"robotasks {task}")))


def helloworld(letter: str) -> tuple[Demonstration, ...]:
    """Return eight writings of a letter on a table, by kinesthetic guidance of a Franka arm.

    Args:
        letter: e, h, l or o.

    Raises:
        InvalidInput: If letter is another one.
        SkillError: If the file is missing and cannot be downloaded.

    Source:
        Auddy et al. 2023, Robotics and Autonomous Systems 165.
    """
    return read_helloworld_npy(dataset_path(info(f"helloworld {letter}")))


def chicken_dance() -> tuple[Demonstration, ...]:
    """Return a chicken dance: the positions of 28 nodes of the body, 12.8 s at 120 Hz.

    Raises:
        SkillError: If the file is missing; it is an extract and is not downloaded.

    Source:
        CMU motion capture database, subject 18, trial 15.
    """
    return read_chicken_dance_npz(dataset_path(info("chicken_dance")))


def mocap6() -> tuple[Demonstration, ...]:
    """Return four sequences of exercises: height of the hips and eleven joint angles, 20 to 45 s at 10 Hz.

    Raises:
        SkillError: If the file is missing; it is an extract and is not downloaded.

    Source:
        Fox, Hughes, Sudderth & Jordan 2014, Annals of Applied Statistics 8(3).
    """
    return read_mocap6_npz(dataset_path(info("mocap6")))


def mocap6_labels() -> tuple[Int[Array, " _"], ...]:
    """Return the exercise at every step of each sequence of `mocap6`, labelled by a person from 1 to 12.

    Raises:
        SkillError: If the file is missing; it is an extract and is not downloaded.

    Source:
        Fox, Hughes, Sudderth & Jordan 2014, Annals of Applied Statistics 8(3).
    """
    return read_mocap6_labels_npz(dataset_path(info("mocap6")))


def letters() -> tuple[Demonstration, ...]:
    """Return letters written with a pen, five each of a, b, c, d, e and m, in that order: velocity and force.

    Raises:
        SkillError: If the file is missing; it is an extract and is not downloaded.

    Source:
        Williams 2006, Character Trajectories, UCI Machine Learning Repository.
    """
    return read_letters_npz(dataset_path(info("letters")))
