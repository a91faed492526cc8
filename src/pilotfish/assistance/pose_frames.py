"""Frames of a recording in the columns of the pose, in the order of the skill."""

from collections.abc import Sequence

import numpy as np

from pilotfish.assistance.phase import select_columns
from pilotfish.demonstrations import Frame, Layout, MovingFrame
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Int
from pilotfish.validation import require_type, short_list

MAX_CONDITION = 1e12  # of the matrix of a frame, as in models.adapt


def match_frames(
    frames: Sequence[Frame | MovingFrame], names: Sequence[str], layout: Layout, recorded: Layout
) -> list[Frame]:
    """Return the frames in the order of the names and the columns of the pose, after checking them.

    Args:
        frames: Frames that a user gives, in the columns of the pose or of the recordings.
        names: Names of the skill's frames.
        layout: Columns of the pose.
        recorded: Columns of the recordings, derivatives included.

    Raises:
        InvalidInput: If a frame is missing, moves, is singular or does not fit the columns.
    """
    require_type(frames, "frames", Sequence, "give a list of frames")
    for frame in frames:
        require_type(frame, "a frame", Frame, "of a moving frame give frame.at(t) for one step t")
    by_name = {frame.name: frame for frame in frames if isinstance(frame, Frame)}
    if sorted(by_name) != sorted(names) or len(frames) != len(names):
        raise InvalidInput(
            f"frames are {short_list([frame.name for frame in frames]) or 'missing'}, expected each of "
            f"{short_list(list(names))} once; rename or add frames"
        )
    return [_pose_frame(by_name[name], layout, recorded) for name in names]


def _pose_frame(frame: Frame, layout: Layout, recorded: Layout) -> Frame:
    """Return a frame in the columns of the pose, after checking it."""
    if frame.b.shape not in ((layout.width,), (recorded.width,)) or frame.A.shape != 2 * frame.b.shape:
        raise InvalidInput(
            f"frame {frame.name!r} has {len(frame.b)} columns, expected {layout.width}: "
            f"{short_list(layout.names)}"
        )
    if len(frame.b) != layout.width:
        columns: Int[Array, " C"] = np.array(recorded.coordinates)
        selected = select_columns(frame, columns)
        frame = Frame(frame.name, selected.A, selected.b)
    frame.require_magnitudes()
    if not (condition := float(np.linalg.cond(frame.A))) < MAX_CONDITION:
        raise InvalidInput(
            f"frame {frame.name!r} is singular: A has condition number {condition:.3g}; check its rotation"
        )
    frame.require_left_multiplication(layout)
    return frame
