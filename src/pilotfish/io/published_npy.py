"""Readers of recordings published as NumPy arrays of several demonstrations."""

import io
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    demonstration,
    pose_layout,
    position_layout,
    unwrap_orientations,
)
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_tables import MAX_ARRAY_ENTRIES, MAX_NPZ_BYTES
from pilotfish.io.paths import read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array

NOMINAL_PERIOD = (
    1 / 60
)  # s, as the publishers' reader has it; rows were resampled to 1000, so time is nominal
CENTIMETRE = 0.01  # m


def read_robotasks_npy(path: str | Path) -> tuple[Demonstration, ...]:
    """Return demonstrations of one household task with a Franka arm: poses in the world frame.

    Centimetres are converted to metres, and sign flips of quaternions are removed. The publishers made the
    end points equal.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        Auddy et al. 2023, Robotics and Autonomous Systems 165, the RoboTasks dataset.
    """
    layout, recorded = pose_layout(), _load_array(path, width=7)
    scale = np.array([CENTIMETRE] * 3 + [1.0] * 4)
    return tuple(
        demonstration(
            unwrap_orientations(_scale(x, scale), layout),
            NOMINAL_PERIOD,
            layout,
            name=f"{Path(path).stem} {m + 1}",
        )
        for m, x in enumerate(recorded)
    )


def read_helloworld_npy(path: str | Path) -> tuple[Demonstration, ...]:
    """Return repeated writings of one letter, guided by hand on a Franka arm: position x y.

    Centimetres are converted to metres. The only frame is the world.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        Auddy et al. 2023, Robotics and Autonomous Systems 165, the HelloWorld dataset.
    """
    layout, recorded = position_layout(axes=2), _load_array(path, width=2)
    return tuple(
        demonstration(_scale(x, CENTIMETRE), NOMINAL_PERIOD, layout, name=f"{Path(path).stem} {m + 1}")
        for m, x in enumerate(recorded)
    )


def _scale(x: Float[Array, "T D"], scale: float | Float[Array, " D"]) -> Float[Array, "T D"]:
    """Return x times scale without a warning about signalling NaN."""
    with np.errstate(invalid="ignore"):
        return np.asarray(x * scale)


def _load_array(path: str | Path, width: int) -> Float[Array, "M T D"]:
    data = read_file(path, "a NumPy array of demonstrations", MAX_NPZ_BYTES)
    try:
        loaded = np.load(io.BytesIO(data), allow_pickle=False)
    except READ_ERRORS as error:
        raise InvalidInput(f"{path}: not an array file that can be read: {error}") from error
    if not isinstance(loaded, np.ndarray) or loaded.size > MAX_ARRAY_ENTRIES:
        raise InvalidInput(
            f"{path} is not one array of at most {MAX_ARRAY_ENTRIES} numbers; save it with numpy.save"
        )
    recorded = numeric_array(loaded, str(path))
    if recorded.ndim != 3 or recorded.shape[2] != width:
        raise InvalidInput(f"{path} has shape {recorded.shape}, expected (M, T, {width})")
    return recorded
