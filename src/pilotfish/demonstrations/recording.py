"""One showing of a task, and the door through which every recording comes in."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.frame_validation import frame, moving_frame
from pilotfish.demonstrations.frames import Frame, MovingFrame, require_left_multiplication, world_frame
from pilotfish.demonstrations.layouts import Layout
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import (
    MAX_MAGNITUDE,
    first_duplicate,
    numeric_array,
    require_number,
    require_printable,
    require_type,
    short_list,
    short_repr,
)

MIN_PERIOD, MAX_PERIOD = 1e-9, 1e9  # s; squares of both, and what they divide, do not overflow
NORM_TOLERANCE = 1e-3  # recordings are rounded; what is within is left as it is


@dataclass(frozen=True, slots=True, eq=False)
class Demonstration:
    """One showing of a task, a row of x every period [s]; the layout says what the columns are.

    frames are the coordinate systems it is to be seen from, at least one, with different names.
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
    """The door for recordings: owns read-only copies, or raises InvalidInput. No frames: the world's alone.

    Refused, with place and nearest fix: fewer than two rows, numbers that are not finite or beyond 1e100, a
    width other than the layout's, orientations that are no unit quaternions (within 1e-3) or - unless they
    are points of S^3, where signs mean nothing - flip sign from one row to the next, a period that is not
    positive, frames that are singular, of another width or length, or that take an orientation off S^3.
    """
    require_printable(name, "the name of a demonstration")
    require_type(layout, "layout", Layout, "pf.demonstrations.position_layout(3) makes one")
    require_type(frames, "frames", Iterable, "give a list of frames; see frame_from_pose")
    label = f"demonstration {name!r}" if name else "demonstration"
    points = numeric_array(x, label)
    _require_shape(label, points, layout)
    _require_finite(label, points, layout)
    _require_bounded(label, points, layout)
    for start in sorted([*layout.orientation_starts, *(columns.start for columns in layout.quaternions)]):
        q, named = points[:, start : start + 4], f"{label}, {layout.names[start][:-2]}"
        _require_unit_norms(named, q)
        if start not in layout.orientation_starts:
            _require_continuous_signs(named, q)
    seconds = require_period(period, f"{label}: period")
    checked = _validate_frames(label, frames, points.shape)
    for given in checked:
        require_left_multiplication(
            f"{label}, frame {given.name!r}", given.A, given.b, layout.orientation_starts
        )
    return Demonstration(points, seconds, layout, checked, name)


def require_period(value: object, label: str) -> float:
    """Return the time between two rows as a float.

    Raises:
        InvalidInput: If it is not a number of seconds from SHORTEST_PERIOD to LONGEST_PERIOD.
    """
    return require_number(value, label, MIN_PERIOD, MAX_PERIOD)


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
        more = f" and {len(bad) - 1} more are not finite" if len(bad) > 1 else ""
        raise InvalidInput(
            f"{label}: row {row} (first is 0), column {layout.names[column]!r} is {x[row, column]}{more}, "
            "expected finite numbers; cut those rows or fill the gap"
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
            f"{NORM_TOLERANCE:g} ({bad.size} such rows); geometry.normalise mends lengths"
        )


def _require_continuous_signs(label: str, q: Float[Array, "T 4"]) -> None:
    dots = np.einsum("td,td->t", q[1:], q[:-1])
    if (bad := np.flatnonzero(dots < 0)).size:
        raise InvalidInput(
            f"{label}: the quaternion flips sign at row {bad[0] + 1} (first is 0), {bad.size} times in all; "
            "q and -q are the same rotation: pass continuous_quaternions(x, layout)"
        )


def _validate_frames(
    label: str, frames: Iterable[Frame | MovingFrame], shape: tuple[int, ...]
) -> tuple[Frame | MovingFrame, ...]:
    steps, width = shape
    checked = tuple(_validate_frame(label, given, steps, width) for given in frames)
    if duplicate := first_duplicate(given.name for given in checked):
        raise InvalidInput(f"{label} has two frames named {duplicate!r}, expected different names")
    return checked or (world_frame(width),)


def _validate_frame(label: str, given: Frame | MovingFrame, steps: int, width: int) -> Frame | MovingFrame:
    if not isinstance(given, Frame | MovingFrame):
        raise InvalidInput(f"{label}: a frame is {short_repr(given)}, expected a Frame; see frame_from_pose")
    try:
        build = moving_frame if isinstance(given, MovingFrame) else frame
        checked = build(given.name, given.A, given.b)
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error
    if checked.b.shape[-1] != width:
        raise InvalidInput(f"{label}: frame {given.name!r} is {checked.b.shape[-1]} wide, expected {width}")
    if isinstance(checked, MovingFrame) and len(checked.b) != steps:
        raise InvalidInput(
            f"{label}: moving frame {given.name!r} has {len(checked.b)} steps, expected {steps}"
        )
    return checked
