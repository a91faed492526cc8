"""Settings that the names, units and values of recordings suggest, and what the user must decide."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from pilotfish.demonstrations.build_settings import BuildSettings, FrameSource, PartSource
from pilotfish.demonstrations.column_groups import (
    ANGLES,
    NORM_TOLERANCE,
    ColumnGroup,
    find_groups,
    split_words,
)
from pilotfish.demonstrations.column_selection import column_names, select_columns
from pilotfish.demonstrations.layouts import Quantity
from pilotfish.demonstrations.reference_frames import describe_different_frames
from pilotfish.demonstrations.rotation_conversion import Representation
from pilotfish.demonstrations.signal_alignment import signal_times
from pilotfish.demonstrations.signals import Recording
from pilotfish.demonstrations.timestamps import held_run, source_period
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, short_list

LARGE_POSITION, LARGE_CENTIMETRES = 10.0, 150.0  # above, positions without a unit are probably in cm and mm
LARGE_ANGLE = 2 * np.pi * 1.05  # rad; above, angles without a unit are probably in degrees
UPRIGHT = 0.02  # sine of half the tilt of an object that stands on a table
TURNED = 0.05  # change of a component of an object that turns

KUKA_ANGLES = ("a", "b", "c")
ORIENTATION_KINDS = ("wxyz", "quaternion", "rpy", "yaw", "matrix", "rotation")


@dataclass(frozen=True, slots=True)
class Question:
    """What names and values of recordings do not reveal, so that the user must decide.

    Attributes:
        subject: "order" of quaternions, unit of "length" or "angle", "period", or "columns".
        text: Question, with what is proposed.
    """

    subject: str
    text: str


@dataclass
class _Draft:
    """Settings and questions while they are collected."""

    recordings: Sequence[Recording]
    parts: list[PartSource] = field(default_factory=list)
    frames: list[FrameSource] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    lengths: set[str] = field(default_factory=set)  # likely units of positions without a unit

    def values(self, group: ColumnGroup) -> Float[Array, "T d"]:
        """Return the finite rows of a group in all recordings."""
        tables = [
            recording.signals[group.signal].values[:, list(group.columns)]
            for recording in self.recordings
            if len(recording.signals) > group.signal
            and recording.signals[group.signal].values.shape[1] > max(group.columns)
        ]
        rows = np.concatenate(tables).astype(np.float64)
        return np.asarray(rows[np.isfinite(rows).all(axis=1)])

    def names(self, group: ColumnGroup) -> tuple[str, ...]:
        """Return the names that select the columns of a group."""
        first = self.recordings[0]
        signal = first.signals[group.signal]
        every = [column for other in first.signals for column in other.columns]
        names = [signal.columns[column] for column in group.columns]
        if any(every.count(name) > 1 for name in names):
            return tuple(f"{signal.name}:{name}" for name in names)
        return tuple(names)

    def has_unit(self, group: ColumnGroup) -> bool:
        """Return whether the file states the unit of a group."""
        units = self.recordings[0].signals[group.signal].units
        return any(units[column].strip() for column in group.columns)


def suggest_settings(recordings: Iterable[Recording]) -> tuple[BuildSettings, tuple[Question, ...]]:
    """Propose how columns of recordings become parts and frames, from their names, units and values.

    The tool's pose becomes the parts "position" and "orientation", and other poses become frames. Grippers
    and forces are parts; joints are parts where the file has no pose. Derivatives and commands are left out.

    The order of a quaternion with named components is known. The norm is 1 in any order, and a rotation that
    is continuous in one order is so in the other. With numbered components, the order is therefore asked for,
    except where an object that turns on a table reveals it: it turns about the vertical axis z only.

    Args:
        recordings: At least one; all have the columns of the first.

    Returns:
        The settings, and the questions that the user must answer because names and values do not. The
        settings have the likelier answer.

    Raises:
        InvalidInput: If recordings is empty, or a later one lacks a proposed column.
    """
    require_type(recordings, "recordings", Iterable, "pass a list of recordings")
    given = list(recordings)
    if not given:
        raise InvalidInput("recordings is empty, expected at least one; see io.readers.read_recordings")
    for recording in given:
        require_type(recording, "a recording", Recording, "read one with io.readers.read_recordings")
        if not recording.signals:
            raise InvalidInput(f"recording {recording.name!r} has no signals, expected at least one")
    draft = _Draft(given)
    groups = find_groups(given[0])
    _propose_poses(draft, groups)
    _propose_scalars(draft, groups)
    if not draft.parts:
        _propose_numbered_columns(draft)
    _ask_for_matrices(draft)
    _ask_for_angles(draft)
    _ask_for_reference_frames(draft)
    settings = BuildSettings(tuple(draft.parts), tuple(draft.frames), _common_period(draft))
    for recording in given:
        for source in settings.parts:
            select_columns(recording, source.columns, f"recording {recording.name!r}: part {source.name!r}")
    return settings, tuple(_separate_lengths(question, draft.lengths) for question in draft.questions)


def _propose_poses(draft: _Draft, groups: Sequence[ColumnGroup]) -> None:
    owners = list(dict.fromkeys(group.owner for group in groups if group.kind == "position"))
    robots = [owner for owner in owners if _is_robot(groups, owner)]
    if owners and not robots and not any(group.kind == "joints" for group in groups):
        robots = owners[:1]
        if len(owners) > 1:
            text = f"Is {' '.join(robots[0])!r} the tool? The other poses become frames."
            draft.questions.append(Question("columns", text))
    order = _order_from_objects(draft, [g for g in groups if g.owner in owners and g.owner not in robots])
    for owner in owners:
        position = next(g for g in groups if g.kind == "position" and g.owner == owner)
        turns = [g for g in groups if g.kind in ORIENTATION_KINDS and g.owner == owner]
        turn = turns[0] if turns else None
        if owner in robots:
            turn = None if turn and turn.kind == "yaw" else turn  # a tool that points down is not upright
            _propose_parts(draft, position, turn, " ".join(owner) if len(robots) > 1 else "", order)
        elif len(position.columns) == 3:
            _propose_frame(draft, position, turn, order)


def _is_robot(groups: Sequence[ColumnGroup], owner: tuple[str, ...]) -> bool:
    return next(group for group in groups if group.owner == owner).is_robot


def _propose_parts(
    draft: _Draft, position: ColumnGroup, turn: ColumnGroup | None, prefix: str, order: Representation | None
) -> None:
    name = f"{prefix} position".strip()
    unit = _length_unit(draft, position, name)
    draft.parts.append(PartSource(name, Quantity.POSITION, draft.names(position), unit))
    if turn is not None:
        name = f"{prefix} orientation".strip()
        kind, unit = _representation(draft, turn, name, order)
        draft.parts.append(PartSource(name, Quantity.QUATERNION, draft.names(turn), unit, kind))


def _propose_frame(
    draft: _Draft, position: ColumnGroup, turn: ColumnGroup | None, order: Representation | None
) -> None:
    name = " ".join(position.owner)
    unit = _length_unit(draft, position, f"frame {name!r}")
    if turn is None:
        draft.frames.append(FrameSource(name, draft.names(position), unit=unit))
        return
    kind, angle_unit = _representation(draft, turn, f"frame {name!r}", order)
    columns = draft.names(position), draft.names(turn)
    draft.frames.append(FrameSource(name, *columns, kind, unit=unit, angle_unit=angle_unit))


def _propose_scalars(draft: _Draft, groups: Sequence[ColumnGroup]) -> None:
    grippers = [group for group in groups if group.kind == "gripper"]
    forces = [group for group in groups if group.kind == "force"]
    joints = [] if draft.parts else [group for group in groups if group.kind == "joints"]
    for name, members in (("joints", joints), ("gripper", grippers)):
        for n, group in enumerate(_merged(members)):
            label = name if n == 0 else f"{name} {n + 1}"
            unit = _angle_unit(draft, group, label) if name == "joints" else ""
            draft.parts.append(PartSource(label, Quantity.SCALAR, draft.names(group), unit))
    for n, group in enumerate(forces):
        label = "force" if n == 0 else f"force {n + 1}"
        unit = "" if draft.has_unit(group) else "N"
        draft.parts.append(PartSource(label, Quantity.VECTOR, draft.names(group), unit))


def _merged(groups: Sequence[ColumnGroup]) -> list[ColumnGroup]:
    """Return one group for each signal."""
    merged: dict[int, ColumnGroup] = {}
    for group in groups:
        known = merged.get(group.signal)
        columns = group.columns if known is None else (*known.columns, *group.columns)
        merged[group.signal] = ColumnGroup(group.kind, group.owner, group.signal, columns)
    return list(merged.values())


def _propose_numbered_columns(draft: _Draft) -> None:
    """Propose parts where no name is known: a pose if four columns have norm 1, scalars otherwise."""
    signal = draft.recordings[0].signals[0]
    columns = tuple(range(len(signal.columns)))
    group = ColumnGroup("quaternion", (), 0, columns)
    values = draft.values(group)
    has_pose = len(columns) >= 7 and len(values) > 0 and not _matrix_columns(draft)
    if has_pose and bool((np.abs(np.linalg.norm(values[:, 3:7], axis=1) - 1) < NORM_TOLERANCE).all()):
        turn = ColumnGroup("quaternion", (), 0, columns[3:7])
        _propose_parts(draft, ColumnGroup("position", (), 0, columns[:3]), turn, "", None)
        columns = columns[7:]
    elif len(columns) in (2, 3):
        _propose_parts(draft, ColumnGroup("position", (), 0, columns), None, "", None)
        columns = ()
    if columns:
        names = draft.names(ColumnGroup("joints", (), 0, columns))
        draft.parts.append(PartSource("state", Quantity.SCALAR, names))
    draft.questions.append(
        Question(
            "columns",
            f"What are the columns {short_list(list(signal.columns))}? Their names do not say; proposed are "
            f"{', '.join(part.name for part in draft.parts)}.",
        )
    )


def _matrix_columns(draft: _Draft) -> list[tuple[str, ...]]:
    """Return columns with one stem and 16 numbers, which may be a 4x4 matrix."""
    stems: dict[tuple[str, ...], list[str]] = {}
    for name in column_names(draft.recordings[0]):
        if len(words := split_words(name)) > 1 and words[-1].isdigit() and words[0] != "column":
            stems.setdefault(tuple(words[:-1]), []).append(name)
    return [tuple(names) for names in stems.values() if len(names) == 16]


def _ask_for_matrices(draft: _Draft) -> None:
    """Ask for a pose in 16 numbered columns that are not used."""
    used = {name.rpartition(":")[2] for part in draft.parts for name in part.columns}
    for names in _matrix_columns(draft):
        if not used & {name.rpartition(":")[2] for name in names}:
            text = (
                f"A pose may be in columns {names[0]} to {names[-1]} (a 4x4 matrix); name it with --settings."
            )
            draft.questions.append(Question("columns", text))


def _ask_for_angles(draft: _Draft) -> None:
    """Ask about angles that make no orientation, of a tool or frame whose orientation is not known."""
    sources = [(part.name, part.columns) for part in draft.parts if part.quantity is Quantity.POSITION]
    has_turn = any(part.quantity is Quantity.QUATERNION for part in draft.parts)
    known = [("the tool", columns) for _, columns in sources[:1] if not has_turn]
    known += [(repr(frame.name), frame.position) for frame in draft.frames if not frame.orientation]
    names = column_names(draft.recordings[0])
    for owner, position in known:
        stem = split_words(position[0].rpartition(":")[2])[:-1]
        found = [name for name in names if _is_angle(split_words(name.rpartition(":")[2]), stem)]
        if any(split_words(name)[-1] in ANGLES for name in found) or len(found) == 3:
            text = (
                f"The orientation of {owner} ({short_list(found)}) is not used. If it turns, name roll, "
                "pitch and yaw, or another form, with --settings."
            )
            draft.questions.append(Question("columns", text))


def _ask_for_reference_frames(draft: _Draft) -> None:
    """Ask about objects whose poses are relative to another frame than the tool's."""
    recording = draft.recordings[0]
    signals = [
        recording.signals[select_columns(recording, columns, label)[0]]
        for columns, label in [
            *((part.columns, part.name) for part in draft.parts if part.quantity is Quantity.POSITION),
            *((frame.position, frame.name) for frame in draft.frames),
        ]
    ]
    if signals and (text := describe_different_frames(signals[0], signals[1:])):
        draft.questions.append(Question("columns", text))


def _is_angle(words: Sequence[str], stem: Sequence[str]) -> bool:
    return bool(words) and list(words[:-1]) == list(stem) and words[-1] in (*ANGLES, *KUKA_ANGLES)


def _representation(
    draft: _Draft, turn: ColumnGroup, label: str, order: Representation | None
) -> tuple[Representation, str]:
    """Return the form of an orientation and the unit of its angles; ask where neither is known."""
    names = short_list(list(draft.names(turn)))
    match turn.kind:
        case "wxyz" | "matrix":
            return turn.kind, ""
        case "rpy" | "yaw":
            return turn.kind, _angle_unit(draft, turn, label)
        case "rotation":
            draft.questions.append(
                Question(
                    "columns",
                    f"Is {label} ({names}) a rotation vector, or roll, pitch and yaw? Proposed is the "
                    "rotation vector, as Universal Robots writes it.",
                )
            )
            return "rotation vector", _angle_unit(draft, turn, label)
        case _:
            is_scalar_first = all(split_words(name)[-2:-1] == ["q"] for name in draft.names(turn))
            proposed: Representation = "wxyz" if is_scalar_first else "xyzw"
            reason = "q0 or q1 is mostly the scalar" if is_scalar_first else "as ROS and robosuite write it"
            if order is None:
                draft.questions.append(
                    Question(
                        "order",
                        f"Is {label} ({names}) in the order w x y z or x y z w? The values do not reveal it; "
                        f"proposed is {' '.join(proposed)}, {reason}.",
                    )
                )
            return order or proposed, ""


def _order_from_objects(draft: _Draft, groups: Sequence[ColumnGroup]) -> Representation | None:
    """Return the order of numbered quaternions if objects that turn about the vertical axis reveal it."""
    found: set[Representation] = set()
    for group in groups:
        if group.kind != "quaternion" or not len(q := np.abs(draft.values(group))):
            continue
        flat, turns = q.max(axis=0) < UPRIGHT, np.ptp(q, axis=0) > TURNED
        if flat[0] and flat[1] and turns[2:].all():
            found.add("xyzw")
        if flat[1] and flat[2] and turns[[0, 3]].all():
            found.add("wxyz")
    return found.pop() if len(found) == 1 else None


def _length_unit(draft: _Draft, group: ColumnGroup, label: str) -> str:
    largest = float(np.abs(draft.values(group)).max(initial=0.0))
    if draft.has_unit(group):
        return ""
    if largest <= LARGE_POSITION:
        draft.lengths.add("m")
        return ""
    unit = "cm" if largest <= LARGE_CENTIMETRES else "mm"
    draft.lengths.add(unit)
    draft.questions.append(
        Question(
            "length",
            f"Is {label} in m, cm or mm? The file states no unit, and values reach {largest:.4g}; proposed "
            f"is {unit}.",
        )
    )
    return unit


def _separate_lengths(question: Question, lengths: set[str]) -> Question:
    """Return a question about a length; with several likely units, only a file of settings answers it."""
    if question.subject != "length" or len(lengths) < 2:
        return question
    text = (
        f"{question.text} Other positions seem to be in another unit: name the unit of each with --settings."
    )
    return Question("columns", text)


def _angle_unit(draft: _Draft, group: ColumnGroup, label: str) -> str:
    if draft.has_unit(group):
        return ""
    largest = float(np.abs(draft.values(group)).max(initial=0.0))
    if largest <= LARGE_ANGLE:
        return "rad"
    draft.questions.append(
        Question(
            "angle",
            f"Is {label} in degrees? The file states no unit, and values reach {largest:.4g}; proposed is "
            "deg.",
        )
    )
    return "deg"


def _common_period(draft: _Draft) -> float | None:
    """Return one period for all recordings [s]; None and a question if no file states times."""
    steps: list[float] = []
    for recording in draft.recordings:
        number, columns = select_columns(recording, draft.parts[0].columns, f"part {draft.parts[0].name!r}")
        signal = recording.signals[number]
        if recording.period is None and all(other.times is None for other in recording.signals):
            draft.questions.append(
                Question("period", "What is the time between two rows [s]? The file has no times.")
            )
            return None
        times = signal_times(recording, number, None)
        if len(times) > 1:
            run = held_run(signal.values[:, list(columns)])
            steps.append(float(np.median(np.diff(times))) * run)
    if not steps:
        raise InvalidInput("every recording has one row, expected at least two")
    return source_period(np.array([0.0, float(np.median(steps))]))
