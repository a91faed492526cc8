"""Doors for recordings that others have published as NumPy arrays of several demonstrations."""

import io
from pathlib import Path

import numpy as np

from pilotfish.demonstrations.layouts import pose_layout, position_layout
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.signs import unwrap_orientations
from pilotfish.errors import InvalidInput
from pilotfish.io.paths import read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.io.tables import MAX_ARRAY_ENTRIES, MAX_NPZ_BYTES
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array

NOMINAL_PERIOD = 1 / 60  # s, by the publishers' own reader; rows were resampled to 1000, so time is nominal
CENTIMETRE = 0.01  # m


def read_robotasks_npy(path: str | Path) -> tuple[Demonstration, ...]:
    """Showings of one household task with a Franka arm: poses, the world's frame alone.

    Centimetres become metres; sign flips of orientations are removed. The end points were made equal by the
    publishers.
    Raises: InvalidInput, when the file is not there or holds other than (M, T, 7) numbers.
    Source: Auddy et al. 2023, Robotics and Autonomous Systems 165, the RoboTasks dataset.
    """
    layout, recorded = pose_layout(), _array(path, width=7)
    scale = np.array([CENTIMETRE] * 3 + [1.0] * 4)
    return tuple(
        demonstration(
            unwrap_orientations(_scaled(x, scale), layout),
            NOMINAL_PERIOD,
            layout,
            name=f"{Path(path).stem} {m + 1}",
        )
        for m, x in enumerate(recorded)
    )


def read_helloworld_npy(path: str | Path) -> tuple[Demonstration, ...]:
    """One letter written several times by hand-guiding a Franka arm: position x y, the world's frame alone.

    Centimetres become metres.
    Raises: InvalidInput, when the file is not there or holds other than (M, T, 2) numbers.
    Source: Auddy et al. 2023, Robotics and Autonomous Systems 165, the HelloWorld dataset.
    """
    layout, recorded = position_layout(axes=2), _array(path, width=2)
    return tuple(
        demonstration(_scaled(x, CENTIMETRE), NOMINAL_PERIOD, layout, name=f"{Path(path).stem} {m + 1}")
        for m, x in enumerate(recorded)
    )


def _scaled(x: Float[Array, "T D"], scale: float | Float[Array, " D"]) -> Float[Array, "T D"]:
    """Return x times scale; a signalling NaN, which warns when it is multiplied, stays NaN."""
    with np.errstate(invalid="ignore"):
        return np.asarray(x * scale)


def _array(path: str | Path, width: int) -> Float[Array, "M T D"]:
    data = read_file(path, "a NumPy array of demonstrations", MAX_NPZ_BYTES)
    try:
        loaded = np.load(io.BytesIO(data), allow_pickle=False)
    except READ_ERRORS as error:
        raise InvalidInput(f"{path}: not an array file that can be read: {error}") from error
    if not isinstance(loaded, np.ndarray) or loaded.size > MAX_ARRAY_ENTRIES:
        raise InvalidInput(f"{path}: expected one array of at most {MAX_ARRAY_ENTRIES} numbers")
    recorded = numeric_array(loaded, str(path))
    if recorded.ndim != 3 or recorded.shape[2] != width:
        raise InvalidInput(f"{path} has shape {recorded.shape}, expected (M, T, {width})")
    return recorded
