"""Template of a folder of demonstrations: a commented manifest and two small tables (docs/folder-format.md).

The tables are an example that learns at once: a hand moves to a cup, turns with it and grips. A user replaces
them by recordings and edits the manifest, whose comments explain every key.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import quaternion_exp
from pilotfish.io.atomic_writes import atomic_folder
from pilotfish.io.demonstration_folder import require_demonstrations, require_replaceable
from pilotfish.io.demonstration_tables import encode_csv
from pilotfish.io.paths import resolve_path
from pilotfish.types import Array, Float
from pilotfish.validation import first_duplicate, require_type, short_repr

PERIOD = 0.05  # s
MOVING_STEPS, RESTING_STEPS = 40, 8
HOME = (0.3, 0.0, 0.4)  # m
CUPS = (((0.55, 0.2, 0.1), 0.6), ((0.6, -0.15, 0.12), -0.3))  # position [m] and turn about z [rad]
FILES = ("reach-1.csv", "reach-2.csv")
PARTS = {
    "position": (
        Part("position", Quantity.POSITION, 3, "m"),
        "where the hand is, in the frame of the robot's base",
    ),
    "orientation": (
        Part("orientation", Quantity.QUATERNION, 4, "1"),
        "how the hand is turned: a unit quaternion in the order w x y z",
    ),
    "gripper": (Part("gripper", Quantity.SCALAR, 1, "1"), "0 is open, 1 is closed"),
}
HEAD = """\
# Demonstrations of one task: this manifest describes the tables beside it, one for each demonstration.
# The tables are an example. Replace them by your recordings, edit this file, and check both:
#
#   pilotfish data check FOLDER
#
# Text after # is a comment. Numbers are in SI units: m, rad, s, N.

format = "pilotfish demonstrations"
version = 1
period = {period}  # time between two rows [s], equal in all tables

# The parts of a row, in the order of the columns. Keys of a part:
#   name        begins the names of its columns: position gives "position x", "position y", "position z"
#   quantity    "position"     x y z: a frame rotates and translates it
#               "quaternion"   w x y z with norm 1, a sign that never jumps: a frame rotates it
#               "orientation"  as "quaternion", but learned as a rotation
#               "vector"       x y z, such as a force: a frame rotates it only
#               "scalar"       any number of columns, such as joint angles: no frame changes it
#   size        number of columns; 4 for a quaternion
#   unit        "m", "rad", "N", "s", or "1" for none
#   derivative  1 for velocities, 0 or left out otherwise; `learn` adds velocities itself
"""
TABLES = """
# One entry for each table. A table is a CSV file: a line of column names, then a line for each time step.
# A first column of times is optional, and must agree with the period. Keys of a demonstration:
#   name    name in messages and figures; may be left out
#   file    name of the table in this folder
#   frames  where the objects were in this demonstration; the same names in the same order in all of them
#
# A frame has a name, a position [m], and one of these, all relative to the robot's base:
#   quaternion = [1.0, 0.0, 0.0, 0.0]                                     w x y z
#   rpy = [0.0, 0.0, 0.5]                                                 roll, pitch and yaw [rad]
#   matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]          rotation matrix, by rows
# With positions of two axes it has a position of two axes and angle = 0.5 [rad]. Instead of a pose, it may
# have a matrix A and an offset b: x_base = A x_frame + b for all columns. Frames that move need NPZ files.
"""
ENTRY = """
[[demonstration]]
name = "reach {number}"
file = "{file}"

[[demonstration.frames]]  # the base does not move; it is a frame because all motions start near it
name = "base"
position = [0.0, 0.0, 0.0]
quaternion = [1.0, 0.0, 0.0, 0.0]

[[demonstration.frames]]
name = "cup"
position = {position}
{turn}
"""


def write_folder_template(
    path: str | Path, *, columns: Sequence[str] = tuple(PARTS), overwrite: bool = False
) -> None:
    """Write a folder with a commented manifest and two example tables, which `read_demonstrations` reads.

    Args:
        path: Folder to write; an empty one is filled.
        columns: Parts of a row: "position", and perhaps "orientation" and "gripper".
        overwrite: Whether a folder of demonstrations may be replaced; nothing else ever is.

    Raises:
        InvalidInput: If columns are unknown or lack the position, or path cannot be written or replaced.
        OutputExists: If the folder appeared in the meantime; the template was written to the `path` of the
            error.

    Example:
        >>> write_folder_template("my-recordings")  # doctest: +SKIP
    """
    chosen = _require_columns(columns)
    require_replaceable(path, overwrite=overwrite)
    target = resolve_path(path)
    layout = Layout(tuple(PARTS[name][0] for name in chosen))
    check = partial(require_demonstrations, target) if overwrite else None
    with atomic_folder(target, check) as folder:
        (folder / "demonstrations.toml").write_text(_manifest(chosen), encoding="utf-8")
        for file, (cup, turn) in zip(FILES, CUPS, strict=True):
            rows = _example_rows(cup, turn)
            table = np.hstack([rows[name] for name in ("time", *chosen)])
            (folder / file).write_bytes(encode_csv(table, ["time [s]", *layout.names]))


def _require_columns(columns: Sequence[str]) -> tuple[str, ...]:
    require_type(columns, "columns", (list, tuple), "pass names, such as ('position', 'gripper')")
    for name in columns:
        if name not in PARTS:
            raise InvalidInput(f"columns has {short_repr(name)}, expected some of {', '.join(PARTS)}")
    if first_duplicate(columns) or "position" not in columns:
        raise InvalidInput(
            f"columns is {short_repr(columns)}, expected different names, with position among them"
        )
    return tuple(columns)


def _manifest(columns: Sequence[str]) -> str:
    texts = [HEAD.format(period=PERIOD)]
    for part, meaning in (PARTS[name] for name in columns):
        texts.append(
            f'\n[[layout]]  # {meaning}\nname = "{part.name}"\nquantity = "{part.quantity.value}"\n'
            f'size = {part.size}\nunit = "{part.unit}"\n'
        )
    texts.append(TABLES)
    first, second = (angle for _, angle in CUPS)
    quaternion = quaternion_exp(np.array([0.0, 0.0, 0.5 * first]))
    turns = (
        f"quaternion = {np.round(quaternion, 6).tolist()}  # w x y z",
        f"rpy = [0.0, 0.0, {second}]  # roll, pitch and yaw [rad]",
    )
    for number, (file, (cup, _), turn) in enumerate(zip(FILES, CUPS, turns, strict=True), start=1):
        texts.append(ENTRY.format(number=number, file=file, position=list(cup), turn=turn))
    return "".join(texts)


def _example_rows(cup: tuple[float, float, float], turn: float) -> dict[str, Float[Array, "T _"]]:
    """Return the columns of a motion from home to the cup, rounded as a recording is."""
    s = np.concatenate([np.linspace(0.0, 1.0, MOVING_STEPS), np.ones(RESTING_STEPS)])
    share = (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]  # minimum jerk
    steps = np.arange(len(s))[:, None]
    tremor = np.sin(np.array([0.31, 0.23, 0.41]) * steps + 10.0 * turn)  # of a hand
    turns = share * [0.0, 0.0, turn] + 0.01 * tremor  # rad
    return {
        "time": np.round(PERIOD * steps, 6),
        "position": np.round(HOME + share * (np.array(cup) - HOME) + 0.001 * tremor, 5),
        "orientation": np.round(quaternion_exp(0.5 * turns), 6),
        "gripper": (steps >= MOVING_STEPS + 2).astype(np.float64),
    }
