"""Readers of recordings published as MATLAB files."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    demonstration,
    frame,
    pose_layout,
    position_layout,
)
from pilotfish.errors import InvalidInput
from pilotfish.io.matlab_limits import require_bounded_expansion
from pilotfish.io.paths import read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.validation import short_list

VALVE_PERIOD = 0.1  # s, from the time row of the file
VALVE_ANGLES = ("180", "135", "90", "45", "157.5", "112.5", "67.5", "22.5")  # degrees
VALVE_FRAMES = ("valve before", "valve after")
ZSHAPE_PERIOD = 0.01  # s, our choice: the file counts steps only
ZSHAPE_COUNT, ZSHAPE_STEPS = 5, 300
MAX_MATLAB_BYTES = 2**26  # of the file, and after expansion; a number may take one byte


def read_valve_mat(path: str | Path) -> tuple[Demonstration, ...]:
    """Return eight openings of a valve by a Baxter arm: four for training, then four for testing.

    Fourteen columns: the pose, then its derivatives as stored (forward differences; the last one uses a
    sample beyond the end, so `add_derivatives` gives another last row). Frames: the valve before and after.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        Tanwani & Calinon 2016, IEEE RA-L 1(1), section VI; the file BaxterValveDemos2.mat.
    """
    records = _load_variable(path, "s")
    if not isinstance(records, list) or len(records) != len(VALVE_ANGLES):
        raise InvalidInput(
            f"{path}: s is not a list of {len(VALVE_ANGLES)} records, expected the valve recording"
        )
    try:
        return tuple(
            _valve_demonstration(record, f"valve {degrees} deg")
            for record, degrees in zip(records, VALVE_ANGLES, strict=True)
        )
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError) as error:
        raise InvalidInput(f"{path}: a record of s is not of the valve recording: {error}") from error


def read_zshape_mat(path: str | Path) -> tuple[Demonstration, ...]:
    """Return five Z-shaped movements of 300 steps: position x y z without a unit, in the world frame.

    The file counts steps, not seconds; the period of 0.01 s is our choice.

    Args:
        path: File as its publishers provide it.

    Raises:
        InvalidInput: If the file cannot be read or is not this recording.

    Source:
        Tanwani 2018, figures 3.1 and 4.2; the file Zshape3D.mat.
    """
    data = np.asarray(_load_variable(path, "Data"))
    if data.shape != (4, ZSHAPE_COUNT * ZSHAPE_STEPS):
        raise InvalidInput(
            f"{path}: Data has shape {data.shape}, expected (4, {ZSHAPE_COUNT * ZSHAPE_STEPS})"
        )
    pieces = np.split(data[1:].T, ZSHAPE_COUNT)  # row 0 is time
    layout = position_layout(axes=3, unit="1")
    return tuple(
        demonstration(x, ZSHAPE_PERIOD, layout, name=f"zshape {m + 1}") for m, x in enumerate(pieces)
    )


def _valve_demonstration(record: dict[str, Any], label: str) -> Demonstration:
    layout = pose_layout().differentiate()
    x = np.vstack([record["Data0"][1:], record["dData0"]]).T  # row 0 is time
    frames = [
        frame(name, p["A"][1:, 1:], p["b"][1:])  # without time
        for name, p in zip(VALVE_FRAMES, record["p"], strict=True)
    ]
    return demonstration(x, VALVE_PERIOD, layout, frames, label)


def _load_variable(path: str | Path, name: str) -> Any:
    """Return one variable of a MATLAB file up to version 7.2, structs as dicts.

    A damaged file may crash SciPy's reader: compare its sha256 first, as `datasets` does.
    """
    from scipy.io import loadmat  # slow to import
    from scipy.io.matlab import MatReadError

    data = read_file(path, "a MATLAB file", MAX_MATLAB_BYTES)
    try:
        require_bounded_expansion(data, MAX_MATLAB_BYTES)
        variables: dict[str, Any] = loadmat(io.BytesIO(data), simplify_cells=True)
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (*READ_ERRORS, MatReadError) as error:
        raise InvalidInput(f"{path}: not a MATLAB file that can be read: {error}") from error
    if name not in variables:
        known = [key for key in variables if not key.startswith("__")]
        raise InvalidInput(f"{path} has the variables {short_list(known)}, expected {name!r} among them")
    return variables[name]
