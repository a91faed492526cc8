"""Demonstrations from recordings of a laboratory: units, orientations and rates are converted.

All signals are interpolated on one time base over their overlap: numbers linearly, orientations by slerp
after their signs are made continuous, and columns of two values from the nearest row. Nothing is extrapolated
or filtered, and every conversion is reported.
"""

from collections.abc import Iterable

import numpy as np

from pilotfish.demonstrations.build_settings import (
    ORIENTATIONS,
    BuildSettings,
    Conversion,
    FrameSource,
    PartSource,
)
from pilotfish.demonstrations.column_selection import select_columns
from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.layouts import Layout, Part, Quantity
from pilotfish.demonstrations.missing_rows import drop_missing_rows
from pilotfish.demonstrations.pose_frames import frame_from_pose, moving_frame_from_poses
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.rotation_conversion import COLUMN_COUNTS, to_quaternions
from pilotfish.demonstrations.signal_alignment import (
    Aligned,
    Alignment,
    align_signals,
    signal_label,
    signal_times,
)
from pilotfish.demonstrations.signals import Recording, Signal
from pilotfish.demonstrations.source_units import columns_in_si
from pilotfish.demonstrations.switches import switching_columns
from pilotfish.demonstrations.timestamps import rows_between
from pilotfish.demonstrations.units import ANGLE, NUMBER
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle
from pilotfish.types import Array, Float
from pilotfish.validation import first_duplicate, require_printable, require_type, short_repr

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
ORDERS = {
    "xyzw": "x y z w reordered to w x y z",
    "rpy": "roll, pitch and yaw converted to quaternions",
    "yaw": "yaw converted to quaternions, upright",
    "matrix": "rotation matrices converted to quaternions",
    "rotation vector": "rotation vectors converted to quaternions",
}
Selection = tuple[int, tuple[int, ...]]  # number of a signal, and numbers of its columns


def build_demonstration(recording: Recording, settings: BuildSettings) -> tuple[Demonstration, Conversion]:
    """Convert a recording to a demonstration in SI units with quaternions w x y z and one period.

    Args:
        recording: Signals as in the file.
        settings: Columns of parts and frames, period and limits; see `suggest_settings`.

    Returns:
        The demonstration, and what was converted.

    Raises:
        InvalidInput: If columns are missing or not finite, a unit is unknown or of another quantity, times do
            not ascend, have a gap or do not overlap, or an orientation is none in the stated form.

    Example:
        >>> import numpy as np
        >>> from pilotfish.demonstrations import BuildSettings, PartSource, Recording, Signal
        >>> hand = Signal("hand", np.array([[0.0], [10.0], [20.0]]), ("x",), ("mm",), np.array([0, 0.1, 0.2]))
        >>> settings = BuildSettings((PartSource("position", "position", ("x",)),))
        >>> demo, conversion = build_demonstration(Recording("first", (hand,)), settings)
        >>> demo.x.ravel().tolist(), conversion.lines
        ([0.0, 0.01, 0.02], ('position: mm converted to m',))
    """
    require_type(recording, "recording", Recording, "read one with io.readers.read_recordings")
    require_type(settings, "settings", BuildSettings, "propose them with suggest_settings")
    _require_consistent(recording)
    try:
        return _build(recording, settings)
    except InvalidInput as error:
        label = f"recording {recording.name!r}"
        known = str(error).startswith((label, "the recording", "demonstration"))
        raise InvalidInput(str(error) if known else f"{label}: {error}") from error


def _build(recording: Recording, settings: BuildSettings) -> tuple[Demonstration, Conversion]:
    pairs = [(source, f"part {source.name!r}") for source in settings.parts]
    for given in settings.frames:
        pairs += [(source, f"frame {given.name!r}: {source.name}") for source in given.sources]
    selections = {label: select_columns(recording, source.columns, label) for source, label in pairs}
    columns = _columns_by_signal(selections.values())
    original = recording
    recording, missing = drop_missing_rows(recording, columns, settings.period)
    moving = {selections[f"part {source.name!r}"][0] for source in settings.parts}
    moving |= {
        selections[f"frame {frame.name!r}: {source.name}"][0]
        for frame in settings.frames
        if frame.moving
        for source in frame.sources
    }
    alignment = align_signals(recording, columns, settings, columns.keys() - moving)
    reader = _SourceReader(recording, alignment, selections, settings.unwrap)
    parts, blocks = zip(*(reader.read_part(source) for source in settings.parts), strict=True)
    layout = Layout(parts)
    frames = [reader.read_frame(given, layout, settings) for given in settings.frames]
    demo = demonstration(np.hstack(blocks), alignment.period, layout, frames, recording.name)
    lines = (*missing, *alignment.lines, *dict.fromkeys(reader.lines))
    return demo, Conversion(lines, _align_labels(original, alignment, settings.period), alignment.times)


class _SourceReader:
    """Converts and interpolates the columns of parts and frames, and collects what it converted."""

    def __init__(
        self,
        recording: Recording,
        alignment: Alignment,
        selections: dict[str, Selection],
        unwrap: tuple[str, ...] | None,
    ) -> None:
        self.recording, self.alignment, self.selections = recording, alignment, selections
        self.unwrap = unwrap
        self.lines: list[str] = []

    def read_part(self, source: PartSource) -> tuple[Part, Float[Array, "T d"]]:
        """Return a part of the layout and its columns."""
        values, unit = self.read(source, f"part {source.name!r}", source.name)
        return Part(source.name, source.quantity, values.shape[1], unit), values

    def read(self, source: PartSource, label: str, name: str) -> tuple[Float[Array, "T d"], str]:
        """Return the columns of a source at the rows of the demonstration, and their unit."""
        number, columns = self.selections[label]
        signal, aligned = self.recording.signals[number], self.alignment.signals[number]
        values, unit, lines = columns_in_si(source, signal, columns, aligned.rows, (label, name))
        self.lines += lines
        if source.quantity in ORIENTATIONS:
            return self._rotations(source, values, aligned, label, name), NUMBER
        if source.quantity is Quantity.SCALAR:
            return self._scalars(source, values, unit, aligned, name), unit
        return aligned.between.interpolate(values), unit

    def _rotations(
        self, source: PartSource, values: Float[Array, "K d"], aligned: Aligned, label: str, name: str
    ) -> Float[Array, "T 4"]:
        q = to_quaternions(values, source.representation, label)
        if source.representation in ORDERS:
            self.lines.append(f"{name}: {ORDERS[source.representation]}")
        if COLUMN_COUNTS[source.representation] == 4:
            flips = int((np.einsum("td,td->t", values[1:], values[:-1]) < 0).sum())
            if flips:
                self.lines.append(f"{name}: the quaternion changed its sign {flips} times; made continuous")
        return aligned.between.interpolate_rotations(q)

    def _scalars(
        self, source: PartSource, values: Float[Array, "K d"], unit: str, aligned: Aligned, name: str
    ) -> Float[Array, "T d"]:
        wanted = unit == ANGLE if self.unwrap is None else source.name in self.unwrap
        if wanted:
            unwrapped = np.unwrap(values, axis=0)
            if jumps := int((np.abs(np.diff(values - unwrapped, axis=0)) > 1.0).sum()):
                self.lines.append(f"{name}: {jumps} jumps of 2 pi removed")
                values = unwrapped
        part = Layout((Part(source.name, Quantity.SCALAR, values.shape[1], unit),))
        switches = [part.names.index(column) for column in switching_columns(values, part)]
        result = aligned.between.interpolate(values)
        if switches and (aligned.between.fraction > 0).any():
            result[:, switches] = values[aligned.between.nearest][:, switches]
            self.lines.append(f"{name}: takes two values, so that rows have the value nearest in time")
        return result

    def read_frame(self, given: FrameSource, layout: Layout, settings: BuildSettings) -> Frame | MovingFrame:
        """Return the frame of an object."""
        label = f"frame {given.name!r}"
        read = [self.read(source, f"{label}: {source.name}", label)[0] for source in given.sources]
        position, turn = read[0], read[1] if len(read) > 1 else np.tile(IDENTITY, (len(read[0]), 1))
        if position.shape[1] != 3:
            raise InvalidInput(f"{label}: position has {position.shape[1]} columns, expected x, y and z")
        if given.moving:
            poses = [Pose(p, q) for p, q in zip(position, turn, strict=True)]
            return moving_frame_from_poses(given.name, layout, poses)
        distance = float(np.linalg.norm(position - position[0], axis=1).max())
        if distance > settings.still_distance:
            _require_found(position, turn, label)
        turned = float(angle(turn, turn[0]).max())
        if distance > settings.still_distance or turned > settings.still_angle:
            self.lines.append(
                f"{label}: the object moves by {distance:.3g} m and {np.degrees(turned):.3g} deg; the frame "
                "is its pose at the first row (set moving if it moves on its own)"
            )
            self.lines += _describe_jump(position, distance, label)
        return frame_from_pose(given.name, layout, Pose(position[0], turn[0]))


def _require_found(position: Float[Array, "T 3"], turn: Float[Array, "T 4"], label: str) -> None:
    """Refuse a still object at the origin of the world until its tracker finds it."""
    is_lost = (position == 0.0).all(axis=1) & (np.abs(turn) == IDENTITY).all(axis=1)
    rows = int(np.argmin(is_lost))  # the first row that is not lost
    if is_lost[0] and rows:
        raise InvalidInput(
            f"{label}: the first {rows} rows have position 0 0 0 without rotation, others not; expected "
            "the pose of a still object in each row; remove those rows from the file, or set moving"
        )


def _describe_jump(position: Float[Array, "T 3"], distance: float, label: str) -> list[str]:
    """Return a line about the longest step of a still object if it makes up most of the motion."""
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    row = int(np.argmax(steps)) if len(steps) else 0
    if not len(steps) or steps[row] <= 0.5 * distance:
        return []
    return [f"{label}: the pose jumps by {steps[row]:.3g} m at row {row + 1} (first is 0); row 0 was taken"]


def _columns_by_signal(selections: Iterable[Selection]) -> dict[int, list[int]]:
    columns: dict[int, list[int]] = {}
    for number, selected in selections:
        known = columns.setdefault(number, [])
        known += [column for column in selected if column not in known]
    return columns


def _align_labels(
    recording: Recording, alignment: Alignment, period: float | None
) -> dict[str, tuple[str, ...]]:
    """Return the label of each row of the demonstration: that of the nearest row of the first signal."""
    if not recording.labels:
        return {}
    nearest = rows_between(signal_times(recording, 0, period), alignment.times).nearest.tolist()
    return {name: tuple(labels[row] for row in nearest) for name, labels in recording.labels.items()}


def _require_consistent(recording: Recording) -> None:
    """Check the shapes and names of a recording, which a reader or a user made."""
    require_printable(recording.name, "the name of a recording")
    if not recording.signals:
        raise InvalidInput(f"recording {recording.name!r} has no signals, expected at least one")
    if duplicate := first_duplicate(signal.name for signal in recording.signals):
        raise InvalidInput(f"recording {recording.name!r} has two signals {duplicate!r}; rename one")
    for number, signal in enumerate(recording.signals):
        _require_table(signal, signal_label(recording, number))
    rows = len(recording.signals[0].values)
    for name, labels in recording.labels.items():
        if len(labels) != rows:
            raise InvalidInput(
                f"recording {recording.name!r} has {len(labels)} labels {short_repr(name)} for {rows} rows, "
                "expected one for each row of the first signal"
            )


def _require_table(signal: Signal, label: str) -> None:
    values = signal.values
    require_type(values, f"{label}: values", np.ndarray, "pass numpy.asarray(values)")
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise InvalidInput(f"{label}: values are {short_repr(values)}, expected an array of shape (T, D)")
    if not len(values):
        raise InvalidInput(f"{label} has no rows, expected at least two")
    if not len(signal.columns) == len(signal.units) == values.shape[1]:
        raise InvalidInput(
            f"{label} has {values.shape[1]} columns, {len(signal.columns)} names and {len(signal.units)} "
            "units, expected one name and unit for each"
        )
