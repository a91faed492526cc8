"""Situation files: the frames of objects now, and the start of the robot."""

import json
import tomllib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import (
    Frame,
    Layout,
    Part,
    Quantity,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose
from pilotfish.io.frame_tables import FORMS, parse_frame
from pilotfish.io.paths import read_file
from pilotfish.models import AdaptedSkill, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, short_list, short_repr

MAX_SITUATION_BYTES = 2**24
MAX_FRAMES = 1000
ORIENTATIONS = (Quantity.QUATERNION, Quantity.ORIENTATION)
KEY_OF_QUANTITY = {Quantity.POSITION: "position", **dict.fromkeys(ORIENTATIONS, "quaternion")}


def read_frames(path: Path, skill: Skill) -> tuple[Frame, ...]:
    """Return the frames listed in a JSON or TOML file, each given by its pose or by A and b.

    Args:
        path: File with a list of frames, or a table with the key frames.
        skill: Skill whose columns the frames have.

    Raises:
        InvalidInput: If the file cannot be used; the message names the file, the frame and the nearest fix.
    """
    content = _read_content(path)
    entries = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(entries, list) or not entries:
        raise InvalidInput(f"{path} has no list of frames, expected a list, or a table with the key frames")
    if len(entries) > MAX_FRAMES:
        raise InvalidInput(f"{path} has {len(entries)} frames, expected at most {MAX_FRAMES}")
    return tuple(_parse_frame(given, f"{path}, frame {n}", skill.layout) for n, given in enumerate(entries))


def read_start(path: Path, model: AdaptedSkill) -> Float[Array, " D"]:
    """Return the start of the robot: `x` with every column, or `position` and `quaternion` at rest.

    If a skill has several parts of one quantity, such as the positions of two arms, each key is the name of
    its part.

    Args:
        path: JSON or TOML file.
        model: Adapted skill whose columns the start has.

    Raises:
        InvalidInput: If the file cannot be used; the message names the file and the nearest fix.
    """
    content = _read_content(path)
    if not isinstance(content, dict):
        raise InvalidInput(
            f"{path} is {short_repr(content)}, expected a table with x, or with position and quaternion"
        )
    if set(content) == {"x"}:
        x = np.array(finite_array(content["x"], f"{path}: x"))
        if x.shape != (model.layout.width,):
            columns = short_list(model.layout.names)
            raise InvalidInput(f"{path}: x has shape {x.shape}, expected ({model.layout.width},): {columns}")
        for first in model.layout.orientation_starts:
            x[first : first + 4] = _normalise(x[first : first + 4], f"{path}: x")
        return x
    return _start_at_rest(content, str(path), model.layout)


def _file_keys(parts: Sequence[Part]) -> list[str]:
    """Return the key of each part: its quantity if no other part has it, else its name."""
    counts = Counter(part.quantity for part in parts)
    return [
        KEY_OF_QUANTITY.get(part.quantity, part.name) if counts[part.quantity] == 1 else part.name
        for part in parts
    ]


def _parse_frame(given: object, label: str, layout: Layout) -> Frame:
    if not isinstance(given, dict):
        raise InvalidInput(f"{label} is {short_repr(given)}, expected a table: {FORMS}")
    try:
        parsed = parse_frame(given, layout)
        return _extend_to_velocities(parsed, layout) if "A" in given else parsed
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _extend_to_velocities(given: Frame, layout: Layout) -> Frame:
    """Extend a frame of the coordinates to their derivatives; angular velocities do not change."""
    n = len(given.b)
    parts = tuple(part for part in layout.parts if not part.derivative)
    if n == layout.width or n != sum(part.size for part in parts):
        return given
    coordinates = Layout(parts)
    if layout.tangent.width != 2 * coordinates.tangent.width:
        return given
    A, b = np.eye(layout.width), np.concatenate([given.b, np.zeros(layout.width - n)])
    A[:n, :n] = given.A
    A[n:, n:] = given.tangent_map(coordinates)
    return Frame(given.name, A, b)


def _start_at_rest(content: dict[str, Any], path: str, layout: Layout) -> Float[Array, " D"]:
    parts = zip(layout.parts, layout.slices, strict=True)
    coordinates = [(part, columns) for part, columns in parts if not part.derivative]
    needed = _file_keys([part for part, _ in coordinates])
    if sorted(content) != sorted(needed):
        raise InvalidInput(
            f"{path} has {short_list(sorted(content))}, expected {short_list(needed)}, or x with every column"
        )
    x = np.zeros(layout.width)
    for (part, columns), key in zip(coordinates, needed, strict=True):
        values = finite_array(content[key], f"{path}: {key}")
        values = values.reshape(1) if part.size == 1 and values.shape == () else values  # gripper = 0.08
        if values.shape != (part.size,):
            raise InvalidInput(f"{path}: {key} has shape {values.shape}, expected ({part.size},)")
        x[columns] = _normalise(values, path) if part.quantity in ORIENTATIONS else values
    return x


def _normalise(q: Float[Array, " 4"], path: str) -> Float[Array, " 4"]:
    try:
        return pose(np.zeros(3), q).quaternion
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error


def _read_content(path: Path) -> Any:
    data = read_file(path, "a JSON or TOML file", MAX_SITUATION_BYTES)
    kind = "TOML" if path.suffix.lower() == ".toml" else "JSON"
    try:
        text = data.decode("utf-8-sig")
        return tomllib.loads(text) if kind == "TOML" else json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{path} is not {kind} that can be read: {error}; correct that line") from error
