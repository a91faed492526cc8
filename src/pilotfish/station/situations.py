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
    require_name,
    tangent_map,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose
from pilotfish.models import AdaptedSkill, Skill, Weights
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, read_file, short_list, short_repr

LARGEST_SITUATION = 2**24  # bytes
MOST_FRAMES = 1000
BY_POSE, BY_MATRIX = {"name", "position", "quaternion"}, {"name", "A", "b"}
TURNS = (Quantity.QUATERNION, Quantity.ORIENTATION)
KEYS = {Quantity.POSITION: "position", **dict.fromkeys(TURNS, "quaternion")}


def frames_in(path: Path, skill: Skill) -> tuple[Frame, ...]:
    """The frames that a JSON or TOML file lists, each by its pose or by A and b.

    Raises: InvalidInput, naming the file, the frame and the nearest fix.
    """
    content = _content(path)
    listed = content.get("frames") if isinstance(content, dict) else content
    if not isinstance(listed, list) or not listed:
        raise InvalidInput(f"{path} has no list of frames; expected a list, or a table with the key frames")
    if len(listed) > MOST_FRAMES:
        raise InvalidInput(f"{path} has {len(listed)} frames, expected at most {MOST_FRAMES}")
    return tuple(_frame(given, f"{path}, frame {n}", skill.layout) for n, given in enumerate(listed))


def start_in(path: Path, model: AdaptedSkill) -> Float[Array, " D"]:
    """The robot's start: {"x": [...]} with every column, or {"position", "quaternion"} at rest.

    Of two positions, two arms say, each is called by the name of its part; so are other quantities.
    Raises: InvalidInput, naming the file and the nearest fix.
    """
    content = _content(path)
    if not isinstance(content, dict):
        raise InvalidInput(f"{path} is no table, expected x, or position and quaternion")
    if set(content) == {"x"}:
        x = np.array(finite_array(content["x"], f"{path}: x"))
        if x.shape != (model.layout.width,):
            columns = short_list(model.layout.names)
            raise InvalidInput(f"{path}: x has shape {x.shape}, expected ({model.layout.width},): {columns}")
        for first in model.layout.turns:
            x[first : first + 4] = _unit(x[first : first + 4], f"{path}: x")
        return x
    return _at_rest(content, str(path), model.layout)


def first_mean(model: AdaptedSkill) -> Float[Array, " D"]:
    """The mean of the state in which the skill most probably begins."""
    dynamics = model.dynamics
    shares = dynamics.weights if isinstance(dynamics, Weights) else dynamics.initial
    return np.asarray(model.means[int(shares.argmax())])


def _keys(parts: Sequence[Part]) -> list[str]:
    """What the file calls each part: its quantity where it is the only one of it, or its name."""
    kinds = Counter(part.quantity for part in parts)
    return [KEYS.get(part.quantity, part.name) if kinds[part.quantity] == 1 else part.name for part in parts]


def _frame(given: object, place: str, layout: Layout) -> Frame:
    if not isinstance(given, dict) or set(given) not in (BY_POSE, BY_MATRIX):
        has = short_list(sorted(given)) if isinstance(given, dict) else short_repr(given)
        raise InvalidInput(f"{place} has {has}, expected name, position, quaternion; or name, A, b")
    try:
        require_name(given["name"], "a frame")
        if set(given) == BY_POSE:
            return frame_from_pose(given["name"], layout, pose(given["position"], given["quaternion"]))
        return _of_whole_width(frame(given["name"], given["A"], given["b"]), layout)
    except InvalidInput as error:
        raise InvalidInput(f"{place}: {error}") from error


def _of_whole_width(given: Frame, layout: Layout) -> Frame:
    """A frame of the columns as they were recorded turns their speeds too, and does not move them.

    Angular velocities, in the axes of the body, stay.
    """
    n = len(given.b)
    still = [
        columns for part, columns in zip(layout.parts, layout.slices, strict=True) if not part.derivative
    ]
    if n != sum(columns.stop - columns.start for columns in still) or layout.tangent.width != 2 * (
        n - len(layout.turns)
    ):
        return given
    A, b = np.eye(layout.width), np.concatenate([given.b, np.zeros(layout.width - n)])
    A[:n, :n] = given.A
    A[n:, n:] = tangent_map(given.A, layout.turns)
    return Frame(given.name, A, b)


def _at_rest(content: dict[str, Any], path: str, layout: Layout) -> Float[Array, " D"]:
    parts = zip(layout.parts, layout.slices, strict=True)
    still = [(part, here) for part, here in parts if part.derivative == 0]
    needed = _keys([part for part, _ in still])
    if sorted(content) != sorted(needed):
        raise InvalidInput(
            f"{path} has {short_list(sorted(content))}, expected {short_list(needed)}, or x with every column"
        )
    x = np.zeros(layout.width)
    for (part, here), key in zip(still, needed, strict=True):
        values = finite_array(content[key], f"{path}: {key}")
        if values.shape != (part.size,):
            raise InvalidInput(f"{path}: {key} has shape {values.shape}, expected ({part.size},)")
        x[here] = _unit(values, path) if part.quantity in TURNS else values
    return x


def _unit(q: Float[Array, " 4"], path: str) -> Float[Array, " 4"]:
    try:
        return pose(np.zeros(3), q).quaternion
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error


def _content(path: Path) -> Any:
    data = read_file(path, "a JSON or TOML file", LARGEST_SITUATION)
    try:
        text = data.decode("utf-8-sig")
        return tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except (ValueError, RecursionError) as error:
        kind = "TOML" if path.suffix.lower() == ".toml" else "JSON"
        raise InvalidInput(f"{path} is no {kind} that can be read: {error}") from error
