"""Frames in TOML and JSON files: by the pose of an object, or by A and b."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pilotfish.demonstrations import Frame, Layout, frame, frame_from_pose, planar_frame, to_quaternions
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, nearest_name, require_name, require_number, short_repr

POSITION, MATRIX_KEYS = "position", ("A", "b")
TURN_KEYS = ("quaternion", "rpy", "matrix", "angle")
KNOWN_KEYS = ("name", POSITION, *TURN_KEYS, *MATRIX_KEYS)
MAX_ANGLE = 6.2832  # rad, a turn
FORMS = (
    "name with position and quaternion (w x y z), rpy [rad] or matrix; in the plane, with position and "
    "angle [rad]; or name, A and b"
)


def parse_frame(table: Mapping[str, Any], layout: Layout) -> Frame:
    """Return the frame that a table gives.

    Args:
        table: Name, and position with one of quaternion, rpy and matrix; a position of two axes with an
            angle; or A and b.
        layout: Columns of the frame; those of A and b are not checked.

    Raises:
        InvalidInput: If keys are missing or unknown, or a value cannot be used.
    """
    for key in table:
        if key not in KNOWN_KEYS:
            near = nearest_name(key, KNOWN_KEYS)
            hint = "give it as quaternion, rpy or matrix" if key == "orientation" else f"expected {FORMS}"
            hint = f"did you mean {near!r}?" if near and key != "orientation" else hint
            raise InvalidInput(f"unknown key {short_repr(key)}; {hint}")
    if "name" not in table:
        raise InvalidInput("key 'name' is missing")
    name = require_name(table["name"], "the name of a frame")
    if any(key in table for key in MATRIX_KEYS):
        _require_keys(table, ("name", *MATRIX_KEYS))
        return frame(name, table["A"], table["b"])
    turns = [key for key in TURN_KEYS if key in table]
    if len(turns) > 1:
        raise InvalidInput(f"frame {name!r} has {turns[0]} and {turns[1]}, expected one of them")
    _require_keys(table, ("name", POSITION, *(turns or ["quaternion"])))
    position = finite_array(table[POSITION], POSITION)
    if turns == ["angle"]:
        angle = require_number(table["angle"], "angle")
        _require_radians(np.array([angle]), "angle")
        return planar_frame(name, layout, position, angle)
    if position.shape == (2,):
        raise InvalidInput(f"position has shape (2,) beside {turns[0]}, expected (3,), or an angle [rad]")
    return frame_from_pose(name, layout, pose(position, _quaternion(turns[0], table[turns[0]])))


def _require_keys(table: Mapping[str, Any], needed: tuple[str, ...]) -> None:
    if missing := [key for key in needed if key not in table]:
        raise InvalidInput(f"key {missing[0]!r} is missing; expected {FORMS}")
    if extra := [key for key in table if key not in needed]:
        raise InvalidInput(f"key {extra[0]!r} does not belong to {', '.join(needed)}; remove it")


def _require_radians(angles: Float[Array, " n"], key: str) -> None:
    if (largest := float(np.abs(angles).max())) > MAX_ANGLE:
        raise InvalidInput(f"{key} has {largest:g}, expected radians of at most 2 pi; convert degrees")


def _quaternion(key: str, value: object) -> Float[Array, " 4"]:
    if key == "quaternion":
        return np.asarray(finite_array(value, key))
    is_angles = key == "rpy"
    numbers = finite_array(value, key, (3,) if is_angles else (3, 3))
    if is_angles:
        _require_radians(numbers, key)
    return np.asarray(to_quaternions(numbers.reshape(1, -1), "rpy" if is_angles else "matrix", key)[0])
