"""Groups of columns that belong together, found from their names: positions, orientations, joints.

A name is split into words at blanks, punctuation and capitals. Its last word may be a component: x, qw, roll
or 3. The words before it, with those of the signal, name the owner and the kind: "tool_pose:pose.position.x"
is a position of "tool", "cube qw" a component of a quaternion of "cube".
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pilotfish.demonstrations.signals import Recording
from pilotfish.types import Array, Float

NORM_TOLERANCE = 0.01
MATRIX_POSITION = (12, 13, 14)  # of a 4x4 matrix by columns, as libfranka writes O_T_EE
MATRIX_ROTATION = (0, 4, 8, 1, 5, 9, 2, 6, 10)  # by rows
Kind = Literal[
    "position", "wxyz", "quaternion", "rpy", "yaw", "matrix", "rotation", "force", "joints", "gripper"
]

Components = tuple[str, ...]
POSITIONS: tuple[Components, ...]
POSITIONS = (("x", "y", "z"), ("px", "py", "pz"), ("posx", "posy", "posz"), ("tx", "ty", "tz"))
QUATERNIONS: tuple[Components, ...]
QUATERNIONS = (("qw", "qx", "qy", "qz"), ("quatw", "quatx", "quaty", "quatz"), ("w", "x", "y", "z"))
ANGLES, ROTATIONS, FORCES = ("roll", "pitch", "yaw"), ("rx", "ry", "rz"), ("fx", "fy", "fz")
YAWS = ("yaw", "heading", "theta")  # of an upright object
MATRICES = tuple(tuple(f"r{i}{j}" for i in range(a, a + 3) for j in range(a, a + 3)) for a in (0, 1))

POSITION_WORDS = {"pos", "position", "positions", "translation", "point"}
TURN_WORDS = {"orientation", "ori", "quaternion", "quat", "quats", "rotation", "rot", "q"}
GENERIC_WORDS = {
    *POSITION_WORDS, *TURN_WORDS, "pose", "poses", "transform", "p", "stamped", "observation", "obs", "state",
    "data", "values",
}  # fmt: skip
OBJECT_WORDS = {"object", "objects", "obj", "marker", "markers"}
ROBOT_WORDS = {
    "tool", "tcp", "ee", "eef", "end", "effector", "hand", "gripper", "flange", "robot", "arm", "wrist",
    "tip", "actual", "measured", "panda", "franka", "fr", "ur", "baxter", "iiwa", "kinova", "xarm",
    "left", "right",
}  # fmt: skip
RATE_WORDS = {
    "velocity", "velocities", "vel", "speed", "twist", "linear", "angular", "acceleration", "acc", "accel",
    "imu", "jerk", "effort", "efforts", "qvel", "dq", "ddq", "qd", "qdd", "current", "torques",
    "tau",
}  # fmt: skip
COMMAND_WORDS = {"command", "commands", "commanded", "cmd", "desired", "setpoint", "action", "actions"}
FORCE_WORDS = {"force", "torque", "wrench", "forces", "ft"}
JOINT_WORDS = {"joint", "joints", "qpos", "jpos", "j", "q", "jointstate"}
ERROR_WORDS = {"error", "residual", "quality", "confidence", "status", "valid"}  # of a tracker or sensor
GRIPPER_WORDS = {"gripper", "grip", "finger", "fingers", "jaw", "suction", "vacuum", "grasp"}


@dataclass(frozen=True, slots=True)
class ColumnGroup:
    """Columns of one quantity of one owner.

    Attributes:
        kind: Quantity; "wxyz" is a quaternion with named components, "quaternion" one with numbered ones,
            "rotation" rx ry rz.
        owner: Words that name the tool or object; empty if none do.
        signal: Number of the signal.
        columns: Numbers of the columns, in the order of the components.
    """

    kind: Kind
    owner: tuple[str, ...]
    signal: int
    columns: tuple[int, ...]

    @property
    def is_robot(self) -> bool:
        """Whether the owner is the tool, and not an object."""
        words = {word.rstrip("0123456789") for word in self.owner}
        return not words or (bool(words & ROBOT_WORDS) and not words & OBJECT_WORDS)


def find_groups(recording: Recording) -> tuple[ColumnGroup, ...]:
    """Return the groups of columns whose names are known, in the order of the file.

    Derivatives and commands are left out.

    Args:
        recording: Recording with at least one signal.
    """
    groups = [group for s in range(len(recording.signals)) for group in _groups_of_signal(recording, s)]
    return tuple(groups)


def split_words(name: str) -> list[str]:
    """Return the words of a name in lower case.

    Args:
        name: Name of a column or signal.
    """
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = [word for word in re.split(r"[\s._/:\-\[\](),]+", spaced.lower()) if word]
    numbered = re.fullmatch(r"([a-z]+)(\d{1,2})", words[-1]) if words else None
    if numbered and words[-1] not in {*MATRICES[0], *MATRICES[1]}:
        words[-1:] = [numbered[1], numbered[2]]
    return words


def _groups_of_signal(recording: Recording, s: int) -> Iterator[ColumnGroup]:
    signal = recording.signals[s]
    stems: dict[tuple[str, ...], dict[str, int]] = {}
    for column, name in enumerate(signal.columns):
        if name.endswith("'"):  # a derivative in the project's own files
            continue
        words = split_words(name)
        stem = tuple(w for w in (*split_words(signal.name), *words[:-1]) if w not in ("column", "columns"))
        is_target = "target" in stem and bool({"tcp", "q"} & {*stem})
        if words and not is_target and not (RATE_WORDS | COMMAND_WORDS | ERROR_WORDS) & {*stem, words[-1]}:
            stems.setdefault(stem, {}).setdefault(words[-1], column)
    for stem, components in stems.items():
        yield from _groups_of_stem(s, stem, components, signal.values)


def _groups_of_stem(
    s: int, stem: tuple[str, ...], components: dict[str, int], values: Float[Array, "T D"]
) -> Iterator[ColumnGroup]:
    owner = tuple(word for word in stem if word not in GENERIC_WORDS)
    owner = tuple(word for word in owner if word not in OBJECT_WORDS) or owner
    is_turn = bool(stem) and stem[-1] in TURN_WORDS
    for kind, names in _named_components(components, stem, is_turn):
        if all(name in components for name in names):
            yield ColumnGroup(kind, owner, s, tuple(components.pop(name) for name in names))
    numbers = sorted((int(word), word) for word in components if word.isdigit())
    columns = tuple(components.pop(word) for _, word in numbers)
    is_turn = is_turn and (stem[-1] != "q" or _has_unit_norm(values[:, list(columns)]))
    yield from _numbered_groups(s, stem, owner, columns, is_turn)
    for word, column in components.items():
        if GRIPPER_WORDS & {*stem, word}:
            yield ColumnGroup("gripper", owner, s, (column,))
        elif JOINT_WORDS & {*stem} or any("joint" in other for other in (*stem, word)):
            yield ColumnGroup("joints", (), s, (column,))


def _has_unit_norm(values: Float[Array, "T d"]) -> bool:
    """Return whether finite rows are unit quaternions: q1 to q4 may also be joints."""
    rows = values[np.isfinite(values).all(axis=1)]
    return bool(len(rows) and (np.abs(np.linalg.norm(rows, axis=1) - 1.0) < NORM_TOLERANCE).all())


def _named_components(
    components: Mapping[str, int], stem: tuple[str, ...], is_turn: bool
) -> Iterator[tuple[Kind, Components]]:
    """Yield the kinds to try, with the names of their components."""
    if FORCE_WORDS & {*stem}:
        yield "force", POSITIONS[0]
    yield "force", FORCES
    for names in MATRICES:
        yield "matrix", names
    yield "rpy", ANGLES
    if not {"roll", "pitch"} & components.keys():
        for name in YAWS:
            yield "yaw", (name,)
    yield "rotation", ROTATIONS
    for names in QUATERNIONS:
        yield "wxyz", names
    if is_turn:
        yield "rotation", POSITIONS[0]
    for names in POSITIONS:
        yield "position", names
    if "z" not in components:
        yield "position", ("x", "y")


def _numbered_groups(
    s: int, stem: tuple[str, ...], owner: tuple[str, ...], columns: tuple[int, ...], is_turn: bool
) -> Iterator[ColumnGroup]:
    words = {*stem}
    if not columns:
        return
    if stem[-3:] == ("o", "t", "ee") and len(columns) == 16:
        yield ColumnGroup("position", owner, s, tuple(columns[n] for n in MATRIX_POSITION))
        yield ColumnGroup("matrix", owner, s, tuple(columns[n] for n in MATRIX_ROTATION))
    elif GRIPPER_WORDS & words and not {"pos", "position", "pose", "quat"} & words:
        yield ColumnGroup("gripper", owner, s, columns)
    elif is_turn and len(columns) == 4:
        yield ColumnGroup("quaternion", owner, s, columns)
    elif JOINT_WORDS & words or any("joint" in word for word in words):
        yield ColumnGroup("joints", (), s, columns)
    elif is_turn and len(columns) == 9:
        yield ColumnGroup("matrix", owner, s, columns)
    elif {"pose"} & words and len(columns) == 7:
        yield ColumnGroup("position", owner, s, columns[:3])
        yield ColumnGroup("quaternion", owner, s, columns[3:])
    elif {"pose"} & words and len(columns) == 6:  # as RTDE writes actual_TCP_pose
        yield ColumnGroup("position", owner, s, columns[:3])
        yield ColumnGroup("rotation", owner, s, columns[3:])
    elif POSITION_WORDS & words and len(columns) in (2, 3):
        yield ColumnGroup("position", owner, s, columns)
