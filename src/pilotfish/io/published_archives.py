"""Doors for extracts of public recordings, kept as archives of named NumPy arrays."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Part, Quantity
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.paths import read_file
from pilotfish.io.tables import MAX_NPZ_BYTES, load_npz
from pilotfish.types import Array, Float, Int

Archive = dict[str, np.ndarray]
Result = TypeVar("Result")

MOCAP6_PERIOD = 0.1  # s, blocks of 12 frames at 120 Hz were averaged
MOCAP6_TRIALS = ("13_29", "13_30", "13_31", "14_06", "14_14", "14_20")  # subject and trial, by sequence
MOCAP6_LENGTH = 0.0254 / 0.45  # m, the unit of length of the CMU skeleton files: an inch by their scale
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
    """One dancer's whole body, once: the position of every node of the skeleton [m], the world's frame alone.

    A part for each node, named as the file names it; y points up.
    Raises: InvalidInput, when the file is not there or not this recording.
    Source: CMU motion capture database, subject 18, trial 15.
    """
    return _read_one(path, _dance_demonstrations)


def read_mocap6_npz(path: str | Path) -> tuple[Demonstration, ...]:
    """People exercising, several exercises on end: the height of the hips [m], then joint angles [rad].

    The publishers took the mean of its sequence from every column and averaged blocks of .1 s. One part a
    column; the world's frame alone. Each is named for its subject and trial at CMU.
    Raises: InvalidInput, when the file is not there or not this recording.
    Source: Fox, Hughes, Sudderth & Jordan 2014, Annals of Applied Statistics 8(3).
    """
    return _read_one(
        path,
        lambda archive: tuple(
            _exercise_demonstration(archive[f"x{n}"], n) for n in _sequence_numbers(archive)
        ),
    )


def read_mocap6_labels_npz(path: str | Path) -> tuple[Int[Array, " _"], ...]:
    """Which exercise a person saw at every step of each sequence of read_mocap6_npz, a number from 1 to 12.

    In order: jumping jacks, jogging, squats, knee raises, arm circles, twists, side reaches, boxing, up and
    down, toe touches with one hand, side bends, toe touches with two hands.
    Raises: as read_mocap6_npz does.
    Source: as there; the labels are by E. Fox, refined by M. Hughes.
    """
    return _read_one(path, lambda archive: tuple(_labels(archive, n) for n in _sequence_numbers(archive)))


def read_letters_npz(path: str | Path) -> tuple[Demonstration, ...]:
    """Letters by a pen on a tablet, several of each: velocity of the tip x y and its force.

    Every column was smoothed and normalised by the publishers and has no unit; the world's frame alone.
    Raises: InvalidInput, when the file is not there or not this recording.
    Source: Williams 2006, Character Trajectories, UCI Machine Learning Repository.
    """
    return _read_one(
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
    with np.errstate(invalid="ignore"):  # a signalling NaN is refused like any other
        scaled = x * scale
    return demonstration(scaled, MOCAP6_PERIOD, layout, name=f"exercises {MOCAP6_TRIALS[n]}")


def mocap6_layout() -> Layout:
    angles = tuple(Part(name, Quantity.SCALAR, 1, "rad") for name in MOCAP6_ANGLES)
    return Layout((Part("hips up", Quantity.SCALAR, 1, "m"), *angles))


def _sequence_numbers(archive: Archive) -> list[int]:
    """Numbers of the sequences that the archive has, in order."""
    found = [n for n in range(len(MOCAP6_TRIALS)) if f"x{n}" in archive]
    if not found:
        raise InvalidInput(f"it holds {_array_names(archive)}, expected sequences x0, x1 ...")
    return found


def _labels(archive: Archive, n: int) -> Int[Array, " _"]:
    labels, steps = archive[f"label{n}"], len(archive[f"x{n}"])
    if labels.shape != (steps,) or labels.dtype.kind not in "iu":
        raise InvalidInput(
            f"label{n} has shape {labels.shape} and entries {labels.dtype}, expected {steps} whole numbers"
        )
    owned = labels.astype(np.int64)
    owned.setflags(write=False)
    return owned


def _letter_demonstration(name: str, x: Float[Array, "T W"]) -> Demonstration:
    tip = Part("position", Quantity.POSITION, 2, "1", derivative=1)
    layout = Layout((tip, Part("force", Quantity.SCALAR, 1, "1")))
    letter, number = name.split("_")
    return demonstration(x, LETTER_PERIOD, layout, name=f"letter {letter.lower()} {int(number) + 1}")


def _letter_names(archive: Archive) -> list[str]:
    found = [name for name in archive if re.fullmatch("[A-Z]_[0-9]{1,4}", name)]
    if not found:
        raise InvalidInput(f"it holds {_array_names(archive)}, expected letters A_0, A_1 ...")
    return found


def _array_names(archive: Archive) -> str:
    return ", ".join(list(archive)[:5]) or "nothing"


def _read_one(path: str | Path, read: Callable[[Archive], Result]) -> Result:
    """What read makes of the archive; whatever is wrong with it names the file."""
    archive = load_npz(read_file(path, "an archive of arrays", MAX_NPZ_BYTES), str(path))
    try:
        return read(archive)
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError, ArithmeticError) as error:
        raise InvalidInput(
            f"{path}: not this recording: {error} (it holds {_array_names(archive)})"
        ) from error
