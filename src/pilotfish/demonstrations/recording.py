"""Demonstration: one evenly sampled recording of a task, with the frames of its objects."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame, world_frame
from pilotfish.demonstrations.layouts import Layout
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import (
    MAX_MAGNITUDE,
    first_duplicate,
    numeric_array,
    require_period,
    require_printable,
    require_type,
    short_list,
    short_repr,
    shorten_repr,
)

NORM_TOLERANCE = 1e-3  # recordings are rounded; norms within this tolerance are accepted unchanged


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Demonstration:
    """One evenly sampled recording of a task; `demonstration` creates it from a user's array.

    Attributes:
        x: One row per sample, read-only.
        period: Time between two rows [s].
        layout: Meaning of the columns.
        frames: Frames of the objects, at least one, with different names.
        name: Name of the recording; may be empty.
    """

    x: Float[Array, "T D"]
    period: float
    layout: Layout
    frames: tuple[Frame | MovingFrame, ...]
    name: str


def demonstration(
    x: object,
    period: float,
    layout: Layout,
    frames: Iterable[Frame | MovingFrame] = (),
    name: str = "",
) -> Demonstration:
    """Check a recording and copy it into a demonstration.

    Args:
        x: One row per sample, at least two rows, with finite values of magnitude at most 1e100. Quaternions
            have norm 1 within 1e-3. Those that are treated as four numbers keep their sign from row to row.
        period: Time between two rows [s], positive.
        layout: Meaning of the columns.
        frames: Frames of the objects, with different names; none for the world frame alone. A moving frame
            has one step per row. A frame maps orientations on S^3 to S^3.
        name: Name of the recording, for messages.

    Returns:
        A demonstration that does not share memory with x.

    Raises:
        InvalidInput: If an argument breaks a condition above; the message gives row, column and nearest fix.

    Example:
        >>> from pilotfish.demonstrations import demonstration, position_layout
        >>> demonstration([[0.0, 0.1], [0.2, 0.1]], period=0.01, layout=position_layout(2)).x.shape
        (2, 2)
    """
    require_printable(name, "the name of a demonstration")
    require_type(layout, "layout", Layout, "create one with demonstrations.position_layout(3)")
    require_type(frames, "frames", Iterable, "pass a list of frames; see frame_from_pose")
    label = f"demonstration {name!r}" if name else "demonstration"
    points = numeric_array(x, label)
    _require_shape(label, points, layout)
    _require_finite(label, points, layout)
    _require_bounded(label, points, layout)
    for columns in layout.unit_quaternions:
        q, quaternion_label = points[:, columns], f"{label}, {layout.names[columns.start][:-2]}"
        _require_unit_norms(quaternion_label, q)
        if columns in layout.quaternions:
            _require_continuous_signs(quaternion_label, q)
    seconds = require_period(period, f"{label}: period")
    return Demonstration(points, seconds, layout, _validate_frames(label, frames, len(points), layout), name)


def _require_shape(label: str, x: Float[Array, "..."], layout: Layout) -> None:
    if x.ndim != 2 or len(x) < 2:
        raise InvalidInput(f"{label} has shape {x.shape}, expected (T, {layout.width}) with T of 2 or more")
    if x.shape[1] != layout.width:
        raise InvalidInput(
            f"{label} has {x.shape[1]} columns, but its layout has {layout.width}: {short_list(layout.names)}"
        )


def _require_finite(label: str, x: Float[Array, "T D"], layout: Layout) -> None:
    if (bad := np.argwhere(~np.isfinite(x))).size:
        row, column = bad[0].tolist()
        more = f" ({len(bad)} such values)" if len(bad) > 1 else ""
        raise InvalidInput(
            f"{label}: row {row} (first is 0), column {layout.names[column]!r} is {x[row, column]}{more}, "
            "expected finite numbers; remove those rows or interpolate them"
        )


def _require_bounded(label: str, x: Float[Array, "T D"], layout: Layout) -> None:
    if (bad := np.argwhere(np.abs(x) > MAX_MAGNITUDE)).size:
        row, column = bad[0].tolist()
        raise InvalidInput(
            f"{label}: row {row} (first is 0), column {layout.names[column]!r} is {x[row, column]:g}, "
            f"expected at most {MAX_MAGNITUDE:g}; check the recording, or choose a larger unit"
        )


def _require_unit_norms(label: str, q: Float[Array, "T 4"]) -> None:
    with np.errstate(over="ignore"):  # a norm too large for float64 is refused like any other
        norms = np.linalg.norm(q, axis=1)
    if (bad := np.flatnonzero(~(np.abs(norms - 1) <= NORM_TOLERANCE))).size:
        raise InvalidInput(
            f"{label}: row {bad[0]} (first is 0) has norm {norms[bad[0]]:.6g}, expected 1 within "
            f"{NORM_TOLERANCE:g} ({bad.size} such rows); call geometry.normalise"
        )


def _require_continuous_signs(label: str, q: Float[Array, "T 4"]) -> None:
    dots = np.einsum("td,td->t", q[1:], q[:-1])
    if (bad := np.flatnonzero(dots < 0)).size:
        raise InvalidInput(
            f"{label}: the quaternion changes sign at row {bad[0] + 1} (first is 0), {bad.size} times in "
            "all; q and -q are the same rotation: pass unwrap_orientations(x, layout)"
        )


def _validate_frames(
    label: str, frames: Iterable[Frame | MovingFrame], steps: int, layout: Layout
) -> tuple[Frame | MovingFrame, ...]:
    checked = tuple(_validate_frame(label, given, steps, layout) for given in frames)
    if duplicate := first_duplicate(given.name for given in checked):
        raise InvalidInput(f"{label} has two frames named {duplicate!r}, expected different names")
    return checked or (world_frame(layout.width),)


def _validate_frame(
    label: str, given: Frame | MovingFrame, steps: int, layout: Layout
) -> Frame | MovingFrame:
    if not isinstance(given, Frame | MovingFrame):
        raise InvalidInput(f"{label}: a frame is {short_repr(given)}, expected a Frame; see frame_from_pose")
    try:
        checked = given.validate(steps, layout.width)
        checked.require_left_multiplication(layout)
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error
    return checked
