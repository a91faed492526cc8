"""Reader of this project's own folders of demonstrations, tolerant of what `read_demonstrations` refuses.

An import resamples rows whose times contradict the period, removes rows that a slower source held, makes the
signs of quaternions continuous, and converts units. A folder is one recording per demonstration: its table,
and a signal of one row for the pose of each frame. The manifest gives the period, which applies to tables
without times, and the units.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import (
    BuildSettings,
    Frame,
    FrameSource,
    Layout,
    PartSource,
    Quantity,
    Recording,
    Signal,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import quaternion_from_rotation_matrix
from pilotfish.io.demonstration_tables import MAX_NPZ_BYTES, decode_npz
from pilotfish.io.import_settings import SETTINGS_ATTRIBUTE, format_import_settings
from pilotfish.io.manifest import MANIFEST_NAMES, MAX_MANIFEST_BYTES, Frames, parse_manifest
from pilotfish.io.paths import is_file, is_folder, read_file
from pilotfish.io.readers import delimited
from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array

FORMAT = "pilotfish demonstrations"
POSE = (*(f"position.{axis}" for axis in "xyz"), *(f"orientation.q{axis}" for axis in "wxyz"))
POSE_UNITS = ("m",) * 3 + ("1",) * 4


def recognises(path: Path) -> bool:
    """Return whether path is a folder with a manifest of demonstrations.

    Args:
        path: File or folder.
    """
    return is_folder(path) and any(_is_manifest(path / name) for name in MANIFEST_NAMES)


def _is_manifest(file: Path) -> bool:
    if not is_file(file):
        return False
    return FORMAT.encode() in read_file(file, "a manifest", MAX_MANIFEST_BYTES)


def read(path: Path, options: ReadOptions | None = None) -> Iterator[Recording]:
    """Read the demonstrations of a folder, one at a time.

    Args:
        path: Folder with a manifest.
        options: Unit of the times.

    Yields:
        A recording per demonstration.

    Raises:
        InvalidInput: If the manifest cannot be used, a table is damaged, or a frame moves or is not a pose.
    """
    name = next(name for name in MANIFEST_NAMES if is_file(path / name))
    manifest = read_file(path / name, "a manifest", MAX_MANIFEST_BYTES)
    period, layout, entries = parse_manifest(manifest, name)
    stated_settings = _settings(layout, next(iter(entries.values()))[2] if entries else {})
    for file, (label, _, frames) in entries.items():
        table = _read_table(path / file, layout, options)
        objects = []
        for frame_name, given in frames.items():
            if not isinstance(given, Frame):
                raise InvalidInput(
                    f"{file}: frame {frame_name!r} moves, and an import converts columns, not matrices; "
                    "import the original recordings"
                )
            if not given.is_world:
                objects.append(_pose_signal(given, layout, f"{file}: frame {frame_name!r}"))
        stated = period if table.times is None else None
        attributes = {SETTINGS_ATTRIBUTE: stated_settings}
        signals = (table, *objects)
        yield Recording(
            label or Path(file).stem, signals, period=stated, format=FORMAT, attributes=attributes
        )


def _settings(layout: Layout, frames: Frames) -> str:
    """Return the parts and frames of the manifest as settings of an import; derivatives are left out."""
    parts = [
        PartSource(part.name, part.quantity, layout.names[columns])
        for part, columns in zip(layout.parts, layout.slices, strict=True)
        if not part.derivative
    ]
    sources = [
        FrameSource(
            name,
            tuple(f"{name}:{column}" for column in POSE[:3]),
            tuple(f"{name}:{column}" for column in POSE[3:]),
        )
        for name, given in frames.items()
        if isinstance(given, Frame) and not given.is_world
    ]
    return format_import_settings(BuildSettings(tuple(parts), tuple(sources)))


def _read_table(file: Path, layout: Layout, options: ReadOptions | None) -> Signal:
    """Return the rows with the units of the layout, and with times if the table has some."""
    if file.suffix == ".npz":
        arrays = decode_npz(read_file(file, "a table of rows", MAX_NPZ_BYTES), file.name)
        x = np.asarray(numeric_array(arrays.get("x", np.zeros(0)), f"{file.name}: array 'x'"))
        if x.ndim != 2 or x.shape[1] != layout.width:
            raise InvalidInput(f"{file.name}: x has shape {x.shape}, expected (T, {layout.width})")
        return Signal("", x, layout.names, _units(layout))
    (recording,) = delimited.read(file, options)
    signal = recording.signals[0]
    units = dict(zip(layout.names, _units(layout), strict=True))
    stated = zip(signal.columns, signal.units, strict=True)
    return replace(signal, name="", units=tuple(unit or units.get(column, "") for column, unit in stated))


def _units(layout: Layout) -> tuple[str, ...]:
    return tuple(part.unit for part in layout.parts for _ in range(part.size))


def _pose_signal(frame: Frame, layout: Layout, label: str) -> Signal:
    """Return the pose of a frame as a signal of one row."""
    columns = next(
        (
            own
            for part, own in zip(layout.parts, layout.slices, strict=True)
            if part.quantity is Quantity.POSITION and part.size == 3 and not part.derivative
        ),
        None,
    )
    if columns is None:
        raise InvalidInput(f"{label} has no position in three axes, expected the pose of an object")
    turn: Float[Array, "3 3"] = frame.A[columns, columns]
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-4 or np.linalg.det(turn) < 0:
        raise InvalidInput(f"{label} is not a rotation of positions, expected the pose of an object")
    row = np.append(frame.b[columns], quaternion_from_rotation_matrix(turn))
    return Signal(frame.name, row[None], POSE, POSE_UNITS)
