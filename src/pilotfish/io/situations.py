"""Where things stand now, from files: the frames of objects, and the robot's start."""

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
    frame,
    frame_from_pose,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose
from pilotfish.io.paths import read_file
from pilotfish.models import AdaptedSkill, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_name, short_list, short_repr

MAX_FILE_SIZE = 2**24  # bytes
MAX_FRAMES = 1000
POSE_KEYS, MATRIX_KEYS = {"name", "position", "quaternion"}, {"name", "A", "b"}
ORIENTATIONS = (Quantity.QUATERNION, Quantity.ORIENTATION)
KEY_OF_QUANTITY = {Quantity.POSITION: "position", **dict.fromkeys(ORIENTATIONS, "quaternion")}


def read_frames(path: Path, skill: Skill) -> tuple[Frame, ...]:
    """The frames that a JSON or TOML file lists, each by its pose or by A and b.

    Raises: InvalidInput, naming the file, the frame and the nearest fix.
    """
    content = _read_content(path)
    entries = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(entries, list) or not entries:
        raise InvalidInput(f"{path} has no list of frames; expected a list, or a table with the key frames")
    if len(entries) > MAX_FRAMES:
        raise InvalidInput(f"{path} has {len(entries)} frames, expected at most {MAX_FRAMES}")
    return tuple(_to_frame(given, f"{path}, frame {n}", skill.layout) for n, given in enumerate(entries))


def read_start(path: Path, model: AdaptedSkill) -> Float[Array, " D"]:
    """The robot's start: {"x": [...]} with every column, or {"position", "quaternion"} at rest.

    Of two positions, two arms say, each is called by the name of its part; so are other quantities.
    Raises: InvalidInput, naming the file and the nearest fix.
    """
    content = _read_content(path)
    if not isinstance(content, dict):
        raise InvalidInput(f"{path} is no table, expected x, or position and quaternion")
    if set(content) == {"x"}:
        x = np.array(finite_array(content["x"], f"{path}: x"))
        if x.shape != (model.layout.width,):
            columns = short_list(model.layout.names)
            raise InvalidInput(f"{path}: x has shape {x.shape}, expected ({model.layout.width},): {columns}")
        for first in model.layout.orientation_starts:
            x[first : first + 4] = _normalise(x[first : first + 4], f"{path}: x")
        return x
    return _start_at_rest(content, str(path), model.layout)


def mean_of_first_state(model: AdaptedSkill) -> Float[Array, " D"]:
    """The mean of the state in which the skill most probably begins."""
    return np.asarray(model.means[int(model.dynamics.initial.argmax())])


def _file_keys(parts: Sequence[Part]) -> list[str]:
    """What the file calls each part: its quantity where it is the only one of it, or its name."""
    kinds = Counter(part.quantity for part in parts)
    return [
        KEY_OF_QUANTITY.get(part.quantity, part.name) if kinds[part.quantity] == 1 else part.name
        for part in parts
    ]


def _to_frame(given: object, place: str, layout: Layout) -> Frame:
    if not isinstance(given, dict) or set(given) not in (POSE_KEYS, MATRIX_KEYS):
        has = short_list(sorted(given)) if isinstance(given, dict) else short_repr(given)
        raise InvalidInput(f"{place} has {has}, expected name, position, quaternion; or name, A, b")
    try:
        require_name(given["name"], "the name of a frame")
        if set(given) == POSE_KEYS:
            return frame_from_pose(given["name"], layout, pose(given["position"], given["quaternion"]))
        return _extend_to_velocities(frame(given["name"], given["A"], given["b"]), layout)
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _extend_to_velocities(given: Frame, layout: Layout) -> Frame:
    """A frame of the columns as they were recorded turns their speeds too, and does not move them.

    Angular velocities, in the axes of the body, stay.
    """
    n = len(given.b)
    coordinates = [
        columns for part, columns in zip(layout.parts, layout.slices, strict=True) if not part.derivative
    ]
    if n != sum(columns.stop - columns.start for columns in coordinates) or layout.tangent.width != 2 * (
        n - len(layout.orientation_starts)
    ):
        return given
    A, b = np.eye(layout.width), np.concatenate([given.b, np.zeros(layout.width - n)])
    A[:n, :n] = given.A
    A[n:, n:] = given.tangent_map(Layout(tuple(part for part in layout.parts if not part.derivative)))
    return Frame(given.name, A, b)


def _start_at_rest(content: dict[str, Any], path: str, layout: Layout) -> Float[Array, " D"]:
    parts = zip(layout.parts, layout.slices, strict=True)
    coordinates = [(part, here) for part, here in parts if part.derivative == 0]
    needed = _file_keys([part for part, _ in coordinates])
    if sorted(content) != sorted(needed):
        raise InvalidInput(
            f"{path} has {short_list(sorted(content))}, expected {short_list(needed)}, or x with every column"
        )
    x = np.zeros(layout.width)
    for (part, here), key in zip(coordinates, needed, strict=True):
        values = finite_array(content[key], f"{path}: {key}")
        if values.shape != (part.size,):
            raise InvalidInput(f"{path}: {key} has shape {values.shape}, expected ({part.size},)")
        x[here] = _normalise(values, path) if part.quantity in ORIENTATIONS else values
    return x


def _normalise(q: Float[Array, " 4"], path: str) -> Float[Array, " 4"]:
    try:
        return pose(np.zeros(3), q).quaternion
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error


def _read_content(path: Path) -> Any:
    data = read_file(path, "a JSON or TOML file", MAX_FILE_SIZE)
    try:
        text = data.decode("utf-8-sig")
        return tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except (ValueError, RecursionError) as error:
        kind = "TOML" if path.suffix.lower() == ".toml" else "JSON"
        raise InvalidInput(f"{path} is no {kind} that can be read: {error}") from error
