"""Anomalies of frames: mirrored, scaled, contradictory, far, lost or held; and a frame that is missing."""

from collections.abc import Iterator, Sequence

import numpy as np

from pilotfish.demonstrations.anomalies_in_rows import Anomaly, jump_rows
from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.geometry import angle, quaternion_from_rotation_matrix
from pilotfish.types import Array, Bool, Float

SCALE_TOLERANCE, TURN_TOLERANCE = 1e-3, 0.02  # of lengths; rad between positions and orientations
FAR = 5.0  # diagonals of the motion, and metres
MIN_HELD_ROWS, MIN_JUMP = 3, 3.0  # rows; usual steps of the frame
MIN_FRAME_STEP = 0.01  # m, after a pose that was held
SAMPLES = 50  # points of a demonstration that are compared
MIN_SPREAD, MAX_ALIGNED = 0.15, 0.25  # of the size of the motion; of the spread before alignment
MIN_PLACES = 3  # demonstrations from which a missing frame can be inferred
NORM_TOLERANCE = 1e-6


def frame_anomalies(demo: Demonstration) -> Iterator[Anomaly]:
    """Yield the anomalies of the frames of a demonstration.

    Args:
        demo: Demonstration.
    """
    position = _position_columns(demo.layout)
    if position is None:
        return
    for frame in demo.frames:
        if frame.is_world:
            continue
        yield from _shape_anomalies(frame, demo.layout, position)
        yield from _distance_anomalies(frame, demo, position)
        if frame.is_moving:
            yield from _track_anomalies(frame, position, demo.period)


def _position_columns(layout: Layout) -> slice | None:
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.POSITION and part.size == 3 and not part.derivative:
            return columns
    return None


def _quaternion_columns(layout: Layout) -> slice | None:
    return next(iter(layout.unit_quaternions), None)


def _shape_anomalies(frame: Frame | MovingFrame, layout: Layout, position: slice) -> Iterator[Anomaly]:
    """Yield whether positions are mirrored or scaled, or turned otherwise than orientations."""
    A = np.atleast_3d(frame.A) if frame.A.ndim == 3 else frame.A[None]
    block = A[:, position, position]
    scales = np.linalg.svd(block, compute_uv=False)
    what = f"frame {frame.name!r}"
    if (np.linalg.det(block) < 0).any():
        yield Anomaly("warning", "mirrored frame", frame.name, f"{what} mirrors positions; no object does")
        return
    if np.abs(scales - 1.0).max() > SCALE_TOLERANCE:
        low, high = float(scales.min()), float(scales.max())
        message = f"{what} scales positions by {low:.4g} to {high:.4g}; no object that only moves does"
        yield Anomaly("warning", "scaled frame", frame.name, message)
        return
    if (columns := _quaternion_columns(layout)) is None:
        return
    first = A[:, columns, columns.start]  # of a left multiplication: the quaternion itself
    norms = np.linalg.norm(first, axis=1)
    if np.abs(norms - 1.0).max() > SCALE_TOLERANCE:
        return
    difference = angle(first / norms[:, None], quaternion_from_rotation_matrix(block))
    if (worst := float(difference.max())) > TURN_TOLERANCE:
        message = (
            f"{what} turns positions and orientations differently, by up to {np.degrees(worst):.3g} deg; "
            "check its matrix"
        )
        yield Anomaly("warning", "contradictory frame", frame.name, message)


def _distance_anomalies(
    frame: Frame | MovingFrame, demo: Demonstration, position: slice
) -> Iterator[Anomaly]:
    """Yield whether an object is far from the motion, as one in other units is."""
    x, b = demo.x[:, position], np.atleast_2d(frame.b)[:, position]
    distance = float(np.linalg.norm(x - b, axis=1).min())
    diagonal = float(np.linalg.norm(np.ptp(x, axis=0)))
    if distance > FAR * max(diagonal, 1.0):
        message = (
            f"frame {frame.name!r} is {distance:.3g} m from the motion, which covers {diagonal:.3g} m; is "
            "its position in another unit?"
        )
        yield Anomaly("warning", "far frame", frame.name, message)


def _track_anomalies(frame: Frame | MovingFrame, position: slice, period: float) -> Iterator[Anomaly]:
    """Yield where the tracker of a moving object seems to have lost it."""
    place, A = frame.b[:, position], frame.A
    is_origin = (place == 0).all(axis=1) & (np.abs(A - np.eye(A.shape[-1])) < 1e-12).all(axis=(1, 2))
    if is_origin.any() and not is_origin.all():
        row, count = int(np.argmax(is_origin)), int(is_origin.sum())
        message = (
            f"frame {frame.name!r} is at the origin without rotation in {count} rows from row {row} (first "
            "is 0): its tracker lost the object"
        )
        yield Anomaly("warning", "lost frame", frame.name, message)
        return
    if held := _held_then_jump(place, _is_same_pose(frame)):
        start, rows, step = held
        message = (
            f"frame {frame.name!r} holds its pose for {rows * period:.3g} s from row {start} (first is 0), "
            f"then jumps by {1e3 * step:.3g} mm: its tracker lost the object"
        )
        yield Anomaly("warning", "held frame", frame.name, message)
    elif (jumps := jump_rows(place)).size and _steps(place)[jumps - 1].max() > MIN_FRAME_STEP:
        message = f"frame {frame.name!r} jumps at row {jumps[0]} (first is 0), {jumps.size} times in all"
        yield Anomaly("warning", "jumps", frame.name, message)


def _steps(place: Float[Array, "T 3"]) -> Float[Array, " S"]:
    return np.asarray(np.linalg.norm(np.diff(place, axis=0), axis=1))


def _is_same_pose(frame: Frame | MovingFrame) -> Bool[Array, " S"]:
    """Return whether each pose equals the one before."""
    same_place = (np.diff(frame.b, axis=0) == 0).all(axis=1)
    return np.asarray(same_place & (np.diff(frame.A, axis=0) == 0).all(axis=(1, 2)))


def _held_then_jump(place: Float[Array, "T 3"], same: Bool[Array, " S"]) -> tuple[int, int, float] | None:
    """Return first row and length of equal poses that end in a jump, and the jump [m]."""
    edges = np.diff(np.concatenate([[0], same.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    steps = _steps(place)
    moving = steps[~same]
    usual = float(np.median(moving)) if moving.size else 0.0
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        is_jump = end < len(steps) and steps[end] > max(MIN_JUMP * usual, MIN_FRAME_STEP)
        if end - start >= MIN_HELD_ROWS and is_jump:
            return start, end - start + 1, float(steps[end])
    return None


def missing_frame(demonstrations: Sequence[Demonstration]) -> Iterator[Anomaly]:
    """Yield whether demonstrations without frames of objects agree only after each is moved and turned.

    Args:
        demonstrations: Demonstrations with equal layouts and frames.
    """
    position = _position_columns(demonstrations[0].layout)
    has_frames = any(not frame.is_world for demo in demonstrations for frame in demo.frames)
    if position is None or has_frames or len(demonstrations) < MIN_PLACES:
        return
    paths = np.stack([_sampled(demo.x[:, position]) for demo in demonstrations])
    size = float(np.median([np.linalg.norm(np.ptp(path, axis=0)) for path in paths]))
    spread = _spread(paths)
    aligned = _spread(_aligned(paths))
    if size > 0 and spread > MIN_SPREAD * size and aligned < MAX_ALIGNED * spread:
        message = (
            f"differ by {1e3 * spread:.3g} mm, but by {1e3 * aligned:.3g} mm after each is moved and turned: "
            "they agree in a frame that is missing, probably that of an object"
        )
        yield Anomaly("warning", "missing frame", "", message)


def _sampled(path: Float[Array, "T 3"]) -> Float[Array, "S 3"]:
    """Return points at equal distances along a path, so that timing does not matter."""
    length = np.concatenate([[0.0], np.cumsum(_steps(path))])
    at = np.linspace(0.0, length[-1], SAMPLES)
    return np.stack([np.interp(at, length, column) for column in path.T], axis=1)


def _spread(paths: Float[Array, "M S 3"]) -> float:
    """Return the root mean square distance from the mean path [m]."""
    return float(np.sqrt(((paths - paths.mean(axis=0)) ** 2).sum(axis=2).mean()))


def _aligned(paths: Float[Array, "M S 3"]) -> Float[Array, "M S 3"]:
    """Return the paths, each moved and turned about the vertical onto the first (Kabsch 1976, in the plane).

    An object on a table turns about the vertical, and so does the motion that it determines.
    """
    reference = paths[0] - paths[0].mean(axis=0)
    aligned = []
    for path in paths:
        centred = path - path.mean(axis=0)
        cross = centred[:, 0] @ reference[:, 1] - centred[:, 1] @ reference[:, 0]
        turn = np.arctan2(cross, (centred[:, :2] * reference[:, :2]).sum())
        c, s = np.cos(turn), np.sin(turn)
        aligned.append(centred @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
    return np.stack(aligned)
