"""Writer of CSV tables for spreadsheets and controllers: a file per demonstration, with times and units.

The first column is `time [s]`. The columns of the rows follow, and then, for each object, its pose: position
[m] and quaternion qw qx qy qz, equal in all rows unless the frame moves. An import finds parts and frames by
these names. `import.toml` has the settings of an import, for layouts whose names do not reveal all: several
positions, joints beside a pose, frames that move, or a period that is not that of a whole rate.
"""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import (
    BuildSettings,
    Demonstration,
    Frame,
    FrameSource,
    Layout,
    MovingFrame,
    PartSource,
    Quantity,
    frame_from_pose,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, quaternion_from_rotation_matrix, unwrap_quaternions
from pilotfish.io.demonstration_tables import encode_csv
from pilotfish.io.import_settings import format_import_settings
from pilotfish.io.paths import is_file, is_folder
from pilotfish.io.writers.exported_demonstrations import export_folder, iter_alike
from pilotfish.types import Array, Float

SETTINGS = "import.toml"
POSITION, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
TOLERANCE = 1e-9  # of the matrix and offset that the pose of a frame gives


def write(demonstrations: Iterable[Demonstration], path: str | Path, *, overwrite: bool = False) -> None:
    """Write a folder with a CSV file per demonstration, and the settings with which an import restores them.

    Args:
        demonstrations: At least one; all share layout and period. A generator is read one at a time.
        path: Folder to write.
        overwrite: Whether a folder of such tables may be replaced; no other folder ever is.

    Raises:
        InvalidInput: If the demonstrations differ in layout or period, a frame is not the pose of an object,
            or path cannot be written or exists.
    """
    with export_folder(path, recognises, "CSV", overwrite=overwrite) as folder:
        for m, demo in enumerate(iter_alike(demonstrations)):
            table, names = _table(demo)
            (folder / _file_name(m, demo)).write_bytes(encode_csv(table, names))
            if m == 0:
                settings = format_import_settings(_settings(demo))
                (folder / SETTINGS).write_text(settings, encoding="utf-8")


def recognises(path: Path) -> bool:
    """Return whether path is a folder that this writer wrote.

    Args:
        path: File or folder.
    """
    if not is_folder(path) or not is_file(path / SETTINGS):
        return False
    return all(file.suffix == ".csv" or file.name == SETTINGS for file in path.iterdir())


def _file_name(m: int, demo: Demonstration) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", demo.name.lower()).strip("-")[:40]
    return "-".join([f"{m + 1:04d}", *filter(None, [words])]) + ".csv"


def _table(demo: Demonstration) -> tuple[Float[Array, "T D"], list[str]]:
    layout = demo.layout
    times = np.round(demo.period * np.arange(len(demo.x)), 12)[:, None]
    names = ["time [s]", *(f"{name} [{unit}]" for name, unit in zip(layout.names, layout.units, strict=True))]
    blocks = [times, demo.x]
    for frame in _objects(demo):
        blocks.append(_poses(frame, demo))
        names += [f"{frame.name} {axis} [m]" for axis in POSITION]
        names += [f"{frame.name} {axis} [1]" for axis in QUATERNION]
    return np.hstack(blocks), names


def _objects(demo: Demonstration) -> list[Frame | MovingFrame]:
    """Return all frames, or none if the only one is the world frame, which an import adds itself."""
    first = demo.frames[0]
    is_alone = len(demo.frames) == 1 and not first.is_moving and first.is_world and first.name == "world"
    return [] if is_alone else list(demo.frames)


def _poses(frame: Frame | MovingFrame, demo: Demonstration) -> Float[Array, "T 7"]:
    """Return the pose of an object in each row."""
    columns = _position_columns(demo.layout)
    if columns is None:
        raise _not_a_pose(frame, demo)
    steps = [frame.at(t) for t in range(len(demo.x))] if isinstance(frame, MovingFrame) else [frame]
    rows = np.array([_pose(step, columns, demo) for step in steps])
    rows[:, 3:] = unwrap_quaternions(rows[:, 3:])
    return np.broadcast_to(rows, (len(demo.x), 7)) if len(steps) == 1 else rows


def _pose(frame: Frame, columns: slice, demo: Demonstration) -> Float[Array, " 7"]:
    """Return position and quaternion of a frame; the sign is that of its map of quaternions, if any."""
    layout, coordinates = demo.layout, list(demo.layout.coordinates)
    turns, A, b = layout.unit_quaternions, frame.A, frame.b
    try:
        q = A[turns[0], turns[0].start] if turns else quaternion_from_rotation_matrix(A[columns, columns])
        expected = frame_from_pose(frame.name, layout, Pose(b[columns], q))
    except InvalidInput as error:
        raise _not_a_pose(frame, demo) from error
    errors = np.column_stack([expected.A - A, expected.b - b])[coordinates]
    if np.abs(errors[:, [*coordinates, -1]]).max() > TOLERANCE * max(1.0, float(np.abs(b).max())):
        raise _not_a_pose(frame, demo)
    return np.append(b[columns], q)


def _not_a_pose(frame: Frame | MovingFrame, demo: Demonstration) -> InvalidInput:
    return InvalidInput(
        f"frame {frame.name!r} of demonstration {demo.name!r} is not the pose of an object in space, and "
        "a CSV table has poses: use the format pilotfish"
    )


def _position_columns(layout: Layout) -> slice | None:
    pairs = zip(layout.parts, layout.slices, strict=True)
    found = (s for p, s in pairs if p.quantity is Quantity.POSITION and p.size == 3 and not p.derivative)
    return next(found, None)


def _settings(demo: Demonstration) -> BuildSettings:
    """Return the settings of an import; velocities are left out, and `learn` adds them again."""
    layout = demo.layout
    parts = [
        PartSource(part.name, part.quantity, layout.names[columns], part.unit)
        for part, columns in zip(layout.parts, layout.slices, strict=True)
        if not part.derivative
    ]
    frames = [
        FrameSource(
            frame.name,
            tuple(f"{frame.name} {axis}" for axis in POSITION),
            tuple(f"{frame.name} {axis}" for axis in QUATERNION),
            moving=frame.is_moving,
        )
        for frame in _objects(demo)
    ]
    return BuildSettings(tuple(parts), tuple(frames), demo.period, unwrap=(), thin=False)
