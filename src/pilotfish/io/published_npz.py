"""Readers of extracts of public recordings, stored as archives of named NumPy arrays."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_tables import MAX_NPZ_BYTES, load_npz
from pilotfish.io.paths import read_file
from pilotfish.types import Array, Float, Int

Archive = dict[str, np.ndarray]
Result = TypeVar("Result")

MOCAP6_PERIOD = 0.1  # s: the mean of 12 frames at 120 Hz
MOCAP6_TRIALS = ("13_29", "13_30", "13_31", "14_06", "14_14", "14_20")  # subject and trial, by sequence
MOCAP6_LENGTH = 0.0254 / 0.45  # m, unit of the CMU skeleton files: an inch divided by their scale
MOCAP6_ANGLES = (
    "lower back rx",
    "lower back ry",
    "upper neck ry",
    "right humerus rz",
    "right radius rx",
    "left humerus rz",
    "left radius rx",
    "right tibia rx",
    "right foot rx",
    "left tibia rx",
    "left foot rx",
)
LETTER_PERIOD = 1 / 200  # s


def read_chicken_dance_npz(path: str | Path) -> tuple[Demonstration, ...]:
    """Return one dance of a person: the position of every node of the skeleton [m].

    Each node is one part, named as in the file; y points up. The only frame is the world.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        CMU motion capture database, subject 18, trial 15.
    """
    return _read_archive(path, _dance_demonstrations)


def read_mocap6_npz(path: str | Path) -> tuple[Demonstration, ...]:
    """Return sequences of exercises of two people: height of the hips [m], then joint angles [rad].

    The publishers subtracted the mean of every column and averaged blocks of 0.1 s. Each column is one part,
    the only frame is the world, and each sequence is named after its subject and trial at CMU.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        Fox, Hughes, Sudderth & Jordan 2014, Annals of Applied Statistics 8(3).
    """
    return _read_archive(
        path,
        lambda archive: tuple(
            _exercise_demonstration(archive[f"x{n}"], n) for n in _sequence_numbers(archive)
        ),
    )


def read_mocap6_labels_npz(path: str | Path) -> tuple[Int[Array, " _"], ...]:
    """Return the exercise at every step of each sequence of `read_mocap6_npz`, from 1 to 12.

    In order: jumping jacks, jogging, squats, knee raises, arm circles, twists, side reaches, boxing, up and
    down, toe touches with one hand, side bends, toe touches with two hands.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        As `read_mocap6_npz`; labels by E. Fox, refined by M. Hughes.
    """
    return _read_archive(
        path, lambda archive: tuple(_read_labels(archive, n) for n in _sequence_numbers(archive))
    )


def read_letters_npz(path: str | Path) -> tuple[Demonstration, ...]:
    """Return letters written with a pen on a tablet: velocity of the tip x y, and its force.

    The publishers smoothed and normalised every column, so they have no unit. The only frame is the world.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        Williams 2006, Character Trajectories, UCI Machine Learning Repository.
    """
    return _read_archive(
        path,
        lambda archive: tuple(_letter_demonstration(name, archive[name]) for name in _letter_names(archive)),
    )


def _dance_demonstrations(archive: Archive) -> tuple[Demonstration]:
    nodes, names = archive["node_pos"], [str(name) for name in archive["node_names"]]
    if nodes.ndim != 3 or nodes.shape[1:] != (len(names), 3):
        raise InvalidInput(f"node_pos has shape {nodes.shape}, expected (T, {len(names)}, 3)")
    layout = Layout(tuple(Part(name, Quantity.POSITION, 3, "m") for name in names))
    x = nodes.reshape(len(nodes), -1)
    return (demonstration(x, 1.0 / float(archive["fs_hz"]), layout, name="chicken dance 18_15"),)


def _exercise_demonstration(x: np.ndarray, n: int) -> Demonstration:
    layout = mocap6_layout()
    if x.ndim != 2 or x.shape[1] != layout.width:
        raise InvalidInput(f"x{n} has shape {x.shape}, expected (T, {layout.width})")
    scale = np.array([MOCAP6_LENGTH] + [np.pi / 180.0] * len(MOCAP6_ANGLES))
    with np.errstate(invalid="ignore"):  # `demonstration` refuses a signalling NaN
        scaled = x * scale
    return demonstration(scaled, MOCAP6_PERIOD, layout, name=f"exercises {MOCAP6_TRIALS[n]}")


def mocap6_layout() -> Layout:
    """Return the columns of `read_mocap6_npz`."""
    angles = tuple(Part(name, Quantity.SCALAR, 1, "rad") for name in MOCAP6_ANGLES)
    return Layout((Part("hips up", Quantity.SCALAR, 1, "m"), *angles))


def _sequence_numbers(archive: Archive) -> list[int]:
    """Return the numbers of the sequences in the archive."""
    found = [n for n in range(len(MOCAP6_TRIALS)) if f"x{n}" in archive]
    if not found:
        raise InvalidInput(f"it has {_array_names(archive)}, expected sequences x0, x1 ...")
    return found


def _read_labels(archive: Archive, n: int) -> Int[Array, " _"]:
    labels, steps = archive[f"label{n}"], len(archive[f"x{n}"])
    if labels.shape != (steps,) or labels.dtype.kind not in "iu":
        raise InvalidInput(
            f"label{n} has shape {labels.shape} and entries {labels.dtype}, expected {steps} whole numbers"
        )
    copied = labels.astype(np.int64)
    copied.setflags(write=False)
    return copied


def _letter_demonstration(name: str, x: Float[Array, "T W"]) -> Demonstration:
    tip = Part("position", Quantity.POSITION, 2, "1", derivative=1)
    layout = Layout((tip, Part("force", Quantity.SCALAR, 1, "1")))
    letter, number = name.split("_")
    return demonstration(x, LETTER_PERIOD, layout, name=f"letter {letter.lower()} {int(number) + 1}")


def _letter_names(archive: Archive) -> list[str]:
    found = [name for name in archive if re.fullmatch("[A-Z]_[0-9]{1,4}", name)]
    if not found:
        raise InvalidInput(f"it has {_array_names(archive)}, expected letters A_0, A_1 ...")
    return found


def _array_names(archive: Archive) -> str:
    return ", ".join(list(archive)[:5]) or "no arrays"


def _read_archive(path: str | Path, build: Callable[[Archive], Result]) -> Result:
    """Return what build makes of the archive; messages name the file."""
    archive = load_npz(read_file(path, "an archive of arrays", MAX_NPZ_BYTES), str(path))
    try:
        return build(archive)
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError, ArithmeticError) as error:
        raise InvalidInput(f"{path}: not this recording: {error} (it has {_array_names(archive)})") from error
