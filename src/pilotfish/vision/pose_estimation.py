"""Pose of a frame from the corners of its markers, by minimal reprojection error.

A single square that is far away has two poses that explain its image almost equally well: it may be tilted
towards or away from the camera. Each marker gives both of them in closed form (Collins and Bartoli 2014).
Each of these is refined over the corners of all markers of the frame (Levenberg-Marquardt). The caller
chooses among the results, by their error and by continuity.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    Pose,
    angle,
    from_rotation_vector,
    rotation_matrix,
    to_rotation_vector,
)
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number, require_type, shorten_repr
from pilotfish.vision.camera import Camera, project
from pilotfish.vision.marker_setup import Marker
from pilotfish.vision.opencv import require_opencv

SAME_ANGLE = 0.5  # degrees between two results that are one


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class PoseCandidate:
    """Pose of a frame that explains the image.

    Attributes:
        camera_from_frame: Pose in camera axes: x right, y down, z ahead.
        error: RMS distance between the corners and their projections [pixels].
        markers: Ids of the markers that were used.
    """

    camera_from_frame: Pose
    error: float
    markers: tuple[int, ...]


def estimate_pose(
    camera: Camera,
    markers: Sequence[Marker],
    corners: Mapping[int, Float[Array, "4 2"]],
    *,
    max_error: float = 2.0,
) -> tuple[PoseCandidate, ...]:
    """Return the poses of a frame that explain the corners of its markers, the smallest error first.

    Of three or more markers, one that contradicts the others is left out, the worst first, until the error is
    at most max_error. Which of two contradicting markers is right cannot be known: their large error remains.

    Args:
        camera: Calibration of the camera.
        markers: Markers of one frame; those without corners are ignored.
        corners: Corners by id, from `detect_markers`.
        max_error: Error above which a marker is left out [pixels].

    Returns:
        No pose if no marker was found, one, or the two of an ambiguous view.

    Raises:
        InvalidInput: If an argument cannot be used, or the markers belong to different frames.
    """
    require_type(camera, "camera", Camera, "read_camera(path) reads one")
    require_number(max_error, "max_error", 1e-6, 1e6)
    visible = _visible_markers(markers, corners)
    while visible:
        candidates = _solve(camera, visible)
        if not candidates or candidates[0].error <= max_error or len(visible) <= 2:
            return candidates
        visible = _without_worst(camera, visible)
    return ()


def _visible_markers(
    markers: Sequence[Marker], corners: Mapping[int, Float[Array, "4 2"]]
) -> list[tuple[Marker, Float[Array, "4 2"]]]:
    require_type(markers, "markers", Sequence, "give a list of Marker")
    require_type(corners, "corners", Mapping, "detect_markers(image, dictionary).corners")
    for marker in markers:
        require_type(marker, "a marker", Marker, "Marker(id, side, frame, pose) creates one")
    if len({marker.frame for marker in markers}) > 1:
        raise InvalidInput("the markers carry different frames, expected those of one frame")
    return [
        (marker, finite_array(corners[marker.id], f"the corners of marker {marker.id}", (4, 2), 1e6))
        for marker in markers
        if marker.id in corners
    ]


def _solve(
    camera: Camera, visible: Sequence[tuple[Marker, Float[Array, "4 2"]]]
) -> tuple[PoseCandidate, ...]:
    """Return the refined results from the two poses of each marker, without repetitions."""
    cv2 = require_opencv()
    points = np.concatenate([marker.corners_in_frame for marker, _ in visible])
    pixels = np.concatenate([found for _, found in visible])
    ids = tuple(marker.id for marker, _ in visible)
    found: list[PoseCandidate] = []
    for marker, square in visible:
        for camera_from_marker in _poses_of_square(cv2, camera, marker, square):
            start = camera_from_marker @ marker.marker_from_frame
            pose = start if len(visible) == 1 else _refine(cv2, camera, points, pixels, start)
            error = _rms(_residuals(camera, pose, points, pixels))
            if np.isfinite(error):
                found.append(PoseCandidate(pose, error, ids))
    return _distinct(sorted(found, key=lambda candidate: candidate.error))


def _poses_of_square(cv2: Any, camera: Camera, marker: Marker, corners: Float[Array, "4 2"]) -> list[Pose]:
    distortion = np.array(camera.distortion)
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            marker.corners, corners, camera.matrix, distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
    except cv2.error:  # corners on a line
        return []
    values = [(np.ravel(turn), np.ravel(shift)) for turn, shift in zip(turns, shifts, strict=True)]
    poses = [
        Pose(shift.astype(float), from_rotation_vector(turn))
        for turn, shift in values
        if np.isfinite(turn).all() and np.isfinite(shift).all() and shift[2] > 0.0
    ]
    return [_refine(cv2, camera, marker.corners, corners, pose) for pose in poses]


def _refine(
    cv2: Any, camera: Camera, points: Float[Array, "N 3"], pixels: Float[Array, "N 2"], start: Pose
) -> Pose:
    """Return the local minimum of the reprojection error near a pose."""
    turn = to_rotation_vector(start.quaternion)
    turn, shift = cv2.solvePnPRefineLM(
        points,
        pixels,
        camera.matrix,
        np.array(camera.distortion),
        turn.reshape(3, 1).copy(),
        start.position.reshape(3, 1).copy(),
    )
    if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
        return start
    return Pose(np.ravel(shift).astype(float), from_rotation_vector(np.ravel(turn)))


def _residuals(
    camera: Camera, pose: Pose, points: Float[Array, "N 3"], pixels: Float[Array, "N 2"]
) -> Float[Array, "N 2"]:
    in_camera = points @ rotation_matrix(pose.quaternion).T + pose.position
    return np.asarray(project(camera, in_camera) - pixels)


def _rms(residuals: Float[Array, "N 2"]) -> float:
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=1))))


def _distinct(candidates: Sequence[PoseCandidate]) -> tuple[PoseCandidate, ...]:
    """Return the candidates whose orientation differs from all better ones."""
    kept: list[PoseCandidate] = []
    for candidate in candidates:
        q = candidate.camera_from_frame.quaternion
        if all(degrees(float(angle(q, other.camera_from_frame.quaternion))) > SAME_ANGLE for other in kept):
            kept.append(candidate)
    return tuple(kept)


def _without_worst(
    camera: Camera, visible: list[tuple[Marker, Float[Array, "4 2"]]]
) -> list[tuple[Marker, Float[Array, "4 2"]]]:
    """Return the markers without the one whose absence lets the others agree best."""
    rest = [visible[:n] + visible[n + 1 :] for n in range(len(visible))]
    solved = [_solve(camera, others) for others in rest]
    errors = [candidates[0].error if candidates else np.inf for candidates in solved]
    return rest[int(np.argmin(errors))]
