"""Poses of one recording in one reference frame, composed from the transforms that the recording has.

Robots publish transforms from frame to frame: a camera in the base, a marker in the camera. A pose in the
camera's frame is not comparable with a tool pose in the base until both are in one frame. Each connected tree
of transforms gets the deepest frame that all poses of messages in it descend from, or its root where it has
transforms only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pilotfish.demonstrations.signals import Signal
from pilotfish.demonstrations.timestamps import rows_between
from pilotfish.errors import InvalidInput
from pilotfish.geometry import multiply, rotation_matrix, unwrap_quaternions
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import require_type, short_list

ROUNDING = 1e-6  # s, of stamps
MAX_GAP = 0.5  # s, between two rows of a transform that changes, around a pose
MIN_NORM, MAX_NORM = 1e-6, 1e6  # of a quaternion's largest component
MAX_POSITION = 1e9  # m
MAX_CHAIN = 1000  # transforms in series
POSITIONS = ("position", "translation", "pose.position", "")
CAMERA_WORDS = ("camera", "optical")
ORIENTATIONS = ("orientation", "rotation", "pose.orientation")


@dataclass(frozen=True, slots=True, eq=False)
class _Transform:
    """Pose of a child frame in its parent over time; one row holds at all times."""

    parent: str
    times: Float[Array, " T"]
    positions: Float[Array, "T 3"]
    quaternions: Float[Array, "T 4"]


def to_common_reference_frames(
    signals: Sequence[Signal], children: Mapping[str, str]
) -> tuple[tuple[Signal, ...], tuple[str, ...]]:
    """Express the poses of each tree of transforms in one reference frame.

    Transforms of frames that other poses are relative to, such as the links of an arm, are used and left out.
    Poses before or after a transform that changes, or in a gap of more than 0.5 s, are left out: where the
    frame was then is not known.

    Args:
        signals: Signals of one recording, with times, whose quaternions are x y z w.
        children: Frame whose pose a signal is, by the name of the signal; transforms only.

    Returns:
        The signals, and what was converted or left out, one sentence each.

    Raises:
        InvalidInput: If a transform has no columns of a position and an orientation.
    """
    require_type(children, "children", Mapping, "pass a frame by the name of each signal of transforms")
    for signal in signals:
        require_type(signal, "a signal", Signal, "read recordings with io.readers.read_recordings")
    transforms, notes = _read_transforms(signals, children)
    parents = {transform.parent for transform in transforms.values()}
    parents |= {signal.reference_frame for signal in signals}
    inner = [s for s in signals if s.name in children and children[s.name] in transforms.keys() & parents]
    poses = [s for s in signals if s.reference_frame and s not in inner]
    bases = _base_frames(poses, children, transforms)
    notes += _describe_cycles(transforms)
    converted: dict[str, Signal] = {}
    for signal in poses:
        if (base := bases[signal.name]) != signal.reference_frame:
            converted[signal.name], note = _express(signal, base, transforms)
            notes.append(note)
    kept = tuple(converted.get(s.name, s) for s in signals if s not in inner)
    if not kept:
        return tuple(signals), tuple(notes)
    if inner:
        names = short_list([s.name for s in inner])
        notes.append(f"{names}: used to convert other poses, and left out")
    return tuple(s for s in kept if len(s.values)), tuple(notes)


def describe_different_frames(tool: Signal, others: Sequence[Signal]) -> str:
    """Return which signals are not relative to the frame of the tool's pose, as a sentence; "" if none.

    A signal whose file states no frame is taken to be in the same one, except beside a camera's frame.

    Args:
        tool: Signal of the tool's pose.
        others: Signals of the other poses.
    """
    own = tool.reference_frame
    different = {
        signal.name: signal.reference_frame
        for signal in others
        if signal.reference_frame != own and ((signal.reference_frame and own) or _has_camera(signal, tool))
    }
    if not different:
        return ""
    frames = short_list(
        [f"{name} is relative to {frame or 'no frame'!r}" for name, frame in different.items()]
    )
    stated = repr(own) if own else "a frame that the file does not state"
    return (
        f"{frames}, but {tool.name} to {stated}, and the transforms of the recording do not connect them. "
        "Are these the same place? If not, record the transforms too (/tf and /tf_static), or convert poses."
    )


def _has_camera(*signals: Signal) -> bool:
    words = " ".join(signal.reference_frame.lower() for signal in signals)
    return any(word in words for word in CAMERA_WORDS)


def _read_transforms(
    signals: Sequence[Signal], children: Mapping[str, str]
) -> tuple[dict[str, _Transform], list[str]]:
    """Return the transforms by their child frame; a child of two signals has none."""
    transforms: dict[str, _Transform] = {}
    notes = []
    named = [child for name, child in children.items() if any(s.name == name for s in signals)]
    for signal in signals:
        if (child := children.get(signal.name)) is None:
            continue
        if named.count(child) > 1:
            notes.append(f"{signal.name}: frame {child!r} has several parents or topics; not composed")
            continue
        positions, turns = _pose_columns(signal)
        if not len(positions) or not turns:
            raise InvalidInput(f"{signal.name}: expected columns translation.x to .z and rotation.x to .w")
        quaternions = _scalar_first(signal.values[:, turns])
        rows = np.flatnonzero(_is_pose(signal.values[:, positions], quaternions))
        if signal.times is not None and len(rows):
            turn = quaternions[rows] / np.linalg.norm(quaternions[rows], axis=1, keepdims=True)
            place = signal.values[:, positions][rows]
            transforms[child] = _Transform(
                signal.reference_frame, signal.times[rows], place, unwrap_quaternions(turn)
            )
    return transforms, notes


def _base_frames(
    poses: Sequence[Signal], children: Mapping[str, str], transforms: Mapping[str, _Transform]
) -> dict[str, str]:
    """Return the frame in which each pose is expressed, by the name of its signal."""
    chains = {s.name: _ancestors(s.reference_frame, transforms) for s in poses}
    bases = {}
    for name, chain in chains.items():
        tree = [other for other, frames in chains.items() if frames[-1] == chain[-1]]
        if all(other in children for other in tree):
            bases[name] = chain[-1]
        else:
            bases[name] = next(frame for frame in chain if all(frame in chains[other] for other in tree))
    return bases


def _ancestors(frame: str, transforms: Mapping[str, _Transform]) -> list[str]:
    """Return a frame and its ancestors, up to the root or the first frame of a cycle."""
    chain = [frame]
    while (transform := transforms.get(chain[-1])) and transform.parent and len(chain) < MAX_CHAIN:
        if transform.parent in chain:
            break
        chain.append(transform.parent)
    return chain


def _describe_cycles(transforms: Mapping[str, _Transform]) -> list[str]:
    """Return a sentence for each cycle of transforms, which has no root."""
    cycles: list[frozenset[str]] = []
    for child in transforms:
        chain = _ancestors(child, transforms)
        last = transforms.get(chain[-1])
        members = (
            frozenset(chain[chain.index(last.parent) :]) if last and last.parent in chain else frozenset()
        )
        if members and members not in cycles:
            cycles.append(members)
    return [
        f"the transforms of {short_list(sorted(cycle))} form a cycle, and are not composed across it"
        for cycle in cycles
    ]


def _express(signal: Signal, base: str, transforms: Mapping[str, _Transform]) -> tuple[Signal, str]:
    """Return a signal in a frame that is an ancestor of its own, and what was done."""
    times = np.zeros(len(signal.values)) if signal.times is None else signal.times
    columns, turns = _pose_columns(signal)
    values, frame = signal.values.copy(), signal.reference_frame
    position = values[:, columns]
    quaternion = _scalar_first(values[:, turns]) if turns else None
    kept = np.ones(len(times), dtype=bool)
    while frame != base:
        transform = transforms[frame]
        kept &= _is_known(transform.times, times)
        p, q = _interpolate(transform, times)
        with np.errstate(over="ignore", invalid="ignore"):  # a pose that is not finite stays so
            position = p + np.einsum("tij,tj->ti", rotation_matrix(q), position)
            quaternion = None if quaternion is None else multiply(q, quaternion)
        frame = transform.parent
    values[:, columns] = position
    if quaternion is not None:
        values[:, turns] = np.roll(quaternion, -1, axis=1)
    own = None if signal.times is None else times[kept]
    note = f"{signal.name}: poses in frame {signal.reference_frame!r} converted to frame {base!r}"
    if lost := int((~kept).sum()):
        note += f"; {lost} of {len(kept)} rows at times without a transform are left out"
    return replace(signal, values=values[kept], times=own, reference_frame=base), note


def _interpolate(
    transform: _Transform, times: Float[Array, " S"]
) -> tuple[Float[Array, "S 3"], Float[Array, "S 4"]]:
    strictly = np.concatenate([[True], np.diff(transform.times) > 0])
    between = rows_between(transform.times[strictly], times)
    turns = unwrap_quaternions(transform.quaternions[strictly])
    return between.interpolate(transform.positions[strictly]), between.interpolate_rotations(turns)


def _is_known(rows: Float[Array, " T"], times: Float[Array, " S"]) -> Bool[Array, " S"]:
    """Return whether a transform is known at each time; one row holds at all times."""
    if len(rows) == 1:
        return np.ones(len(times), dtype=bool)
    inside = (times >= rows[0] - ROUNDING) & (times <= rows[-1] + ROUNDING)
    after = np.clip(np.searchsorted(rows, times), 1, len(rows) - 1)
    return np.asarray(inside & (rows[after] - rows[after - 1] <= MAX_GAP))


def _pose_columns(signal: Signal) -> tuple[Int[Array, " 3"], list[int]]:
    """Return the numbers of the columns of position, and of orientation x y z w if the signal has one."""
    names = {name: number for number, name in enumerate(signal.columns)}

    def find(prefixes: Sequence[str], axes: str) -> list[int]:
        for prefix in prefixes:
            wanted = [f"{prefix}.{axis}".lstrip(".") for axis in axes]
            if all(name in names for name in wanted):
                return [names[name] for name in wanted]
        return []

    return np.array(find(POSITIONS, "xyz"), dtype=np.int64), find(ORIENTATIONS, "xyzw")


def _scalar_first(xyzw: Float[Array, "T 4"]) -> Float[Array, "T 4"]:
    return np.asarray(np.roll(xyzw, 1, axis=1))


def _is_pose(position: Float[Array, "T 3"], q: Float[Array, "T 4"]) -> Bool[Array, " T"]:
    """Return whether rows are finite and of a size that a transform may have."""
    largest, size = np.abs(position).max(axis=1, initial=0.0), np.abs(q).max(axis=1, initial=0.0)
    return np.asarray((largest < MAX_POSITION) & (size > MIN_NORM) & (size < MAX_NORM))  # False for NaN
