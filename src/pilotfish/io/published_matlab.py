"""Doors for recordings that others have published in MATLAB files."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import frame
from pilotfish.demonstrations.frames import Frame
from pilotfish.demonstrations.layouts import pose_layout, position_layout
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.matlab_sizes import require_bounded_expansion
from pilotfish.io.paths import read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.validation import short_list

VALVE_PERIOD = 0.1  # s, the file's own time row
VALVE_ANGLES = ("180", "135", "90", "45", "157.5", "112.5", "67.5", "22.5")  # degrees
VALVE_FRAMES = ("valve before", "valve after")
ZSHAPE_PERIOD = 0.01  # s, chosen: the file counts steps 1 to 300 and says nothing of seconds
ZSHAPE_COUNT, ZSHAPE_STEPS = 5, 300
MAX_MATLAB_BYTES = 2**26  # bytes of a file, and of what it expands to; a number may take one byte there


def read_valve_mat(path: str | Path) -> tuple[Demonstration, ...]:
    """Eight openings of a valve by a Baxter arm, the first four to learn from, the last four to test with.

    Fourteen columns: pose, then derivatives as the file has them (forward differences; the last looks one
    sample past the end, so with_derivatives gives another last row). Frames: the valve before and after.
    Raises: InvalidInput, when the file is not there or not this recording.
    Source: Tanwani & Calinon 2016, IEEE RA-L 1(1), sec. VI; the file BaxterValveDemos2.mat.
    """
    records = _variables(path, "s")["s"]
    if not isinstance(records, list) or len(records) != len(VALVE_ANGLES):
        raise InvalidInput(f"{path}: s is not a list of {len(VALVE_ANGLES)} records: not the valve recording")
    try:
        return tuple(
            _valve_demonstration(record, f"valve {degrees} deg")
            for record, degrees in zip(records, VALVE_ANGLES, strict=True)
        )
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError) as error:
        raise InvalidInput(f"{path}: a record of s is not one of the valve recording: {error}") from error


def read_zshape_mat(path: str | Path) -> tuple[Demonstration, ...]:
    """Five Z-shaped movements of 300 steps: position x y z in a unit of its own, the world's frame alone.

    The file counts steps, not seconds: the period of .01 s is our choice.
    Raises: InvalidInput, when the file is not there or not this recording.
    Source: Tanwani 2018, figures 3.1 and 4.2; the file Zshape3D.mat.
    """
    data = np.asarray(_variables(path, "Data")["Data"])
    if data.shape != (4, ZSHAPE_COUNT * ZSHAPE_STEPS):
        raise InvalidInput(
            f"{path}: Data has shape {data.shape}, expected (4, {ZSHAPE_COUNT * ZSHAPE_STEPS})"
        )
    pieces = np.split(data[1:].T, ZSHAPE_COUNT)  # the leading row is time
    layout = position_layout(axes=3, unit="1")
    return tuple(
        demonstration(x, ZSHAPE_PERIOD, layout, name=f"zshape {m + 1}") for m, x in enumerate(pieces)
    )


def _valve_demonstration(record: dict[str, Any], name: str) -> Demonstration:
    layout = pose_layout().differentiate()
    x = np.vstack([record["Data0"][1:], record["dData0"]]).T  # the leading row is time
    frames = [_drop_time(n, p["A"], p["b"]) for n, p in zip(VALVE_FRAMES, record["p"], strict=True)]
    return demonstration(x, VALVE_PERIOD, layout, frames, name)


def _drop_time(name: str, A: Any, b: Any) -> Frame:
    return frame(name, A[1:, 1:], b[1:])


def _variables(path: str | Path, name: str) -> dict[str, Any]:
    """Everything in a MATLAB file (up to version 7.2), structs as dicts; it must hold the variable named.

    A damaged file may crash SciPy's reader itself: compare its sha256 first, as datasets does.
    """
    from scipy.io import loadmat  # slow to import, and only wanted here
    from scipy.io.matlab import MatReadError

    data = read_file(path, "a MATLAB file", MAX_MATLAB_BYTES)
    try:
        require_bounded_expansion(data, MAX_MATLAB_BYTES)
        found: dict[str, Any] = loadmat(io.BytesIO(data), simplify_cells=True)
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (*READ_ERRORS, MatReadError) as error:
        raise InvalidInput(f"{path}: not a MATLAB file that can be read: {error}") from error
    if name not in found:
        there = [key for key in found if not key.startswith("__")]
        raise InvalidInput(f"{path} has the variables {short_list(there)}, expected {name!r} among them")
    return found
