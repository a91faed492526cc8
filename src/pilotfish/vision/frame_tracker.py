"""Poses of frames over a sequence of images: choice between ambiguous poses, rejection and loss.

Each pose is the raw estimate of its image; nothing is filtered, and nothing is repeated where a frame is not
visible. A pose is rejected if its reprojection error is too large, or if the frame would have moved faster
than is plausible since its last accepted pose. The allowed distance grows with the time since then, so that
one wrong pose cannot lock out the right ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import degrees

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle
from pilotfish.types import Array, UInt8
from pilotfish.validation import require_number, require_type, shorten_repr
from pilotfish.vision.detection import Detections, detect_markers
from pilotfish.vision.marker_setup import Marker, MarkerSetup
from pilotfish.vision.picture import draw_detections
from pilotfish.vision.pose_estimation import PoseCandidate, estimate_pose

# A pose is as plausible as the best one if its error is at most this factor or this many pixels larger.
AMBIGUOUS_FACTOR, AMBIGUOUS_ERROR = 1.5, 0.1
AMBIGUOUS_ANGLE = 5.0  # degrees between two poses that differ
IDENTITY = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
MEMORY = 1.0  # s for which a pose decides between ambiguous ones


class Rejection(StrEnum):
    """Why an image gives no pose of a frame."""

    NOT_FOUND = "marker not found"
    REPEATED = "marker found twice"
    REFERENCE = "reference marker not found"
    ERROR = "reprojection error too large"
    JUMP = "jump"


@dataclass(frozen=True, slots=True)
class TrackerSettings:
    """Bounds of the estimates that are accepted.

    Attributes:
        max_error: Largest reprojection error [pixels].
        max_speed: Largest plausible speed of a frame [m/s].
        max_angular_speed: Largest plausible angular speed of a frame [rad/s].
    """

    max_error: float = 2.0
    max_speed: float = 2.0
    max_angular_speed: float = 15.0

    def __post_init__(self) -> None:
        """Check all values."""
        for name in ("max_error", "max_speed", "max_angular_speed"):
            require_number(getattr(self, name), name, 1e-6, 1e6)


DEFAULT_SETTINGS = TrackerSettings()


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """What one image says about a frame.

    Attributes:
        pose: Pose in the base frame, or in camera axes if neither the camera's pose nor a reference is known;
            None if the frame is not visible or its pose was rejected.
        error: RMS reprojection error [pixels]; NaN if no pose was estimated.
        rejection: Why pose is None; None with a pose.
        ambiguous: Whether another orientation explains the image as well, and no earlier pose decided.
    """

    pose: Pose | None
    error: float = np.nan
    rejection: Rejection | None = None
    ambiguous: bool = False


class FrameTracker:
    """Estimator of the poses of frames in successive images.

    Attributes:
        setup: Markers and camera.
        settings: Bounds of accepted poses.
    """

    def __init__(self, setup: MarkerSetup, settings: TrackerSettings = DEFAULT_SETTINGS) -> None:
        """Start without a pose of any frame.

        Args:
            setup: Markers and camera.
            settings: Bounds of accepted poses.

        Raises:
            InvalidInput: If an argument has another type.
        """
        require_type(setup, "setup", MarkerSetup, "read_markers(path) reads one")
        require_type(settings, "settings", TrackerSettings, "TrackerSettings() creates one")
        self.setup, self.settings = setup, settings
        self._accepted: dict[str, tuple[float, Pose]] = {}
        self._time = -np.inf
        self._last_base_from_camera = IDENTITY

    def observe(self, image: UInt8[Array, "H W *C"], time: float) -> dict[str, Observation]:
        """Return the observation of each frame in the next image.

        Args:
            image: Grey image, or colour image in the order blue, green, red; of the size of the camera.
            time: Time of the image, later than that of the last one [s].

        Raises:
            InvalidInput: If the image has another size, or time does not increase.
        """
        time = require_number(time, "time")
        if not time > self._time:
            raise InvalidInput(f"time is {time:g} s after {self._time:g} s, expected increasing times")
        detections = detect_markers(image, self.setup.dictionary)
        self._require_size(image)
        self._time = time
        base_from_camera = self._base_from_camera(detections)
        self._last_base_from_camera = base_from_camera or IDENTITY
        return {
            name: self._observe_frame(name, detections, base_from_camera, time) for name in self.setup.frames
        }

    def draw(
        self, image: UInt8[Array, "H W *C"], observations: dict[str, Observation]
    ) -> UInt8[Array, "H W 3"]:
        """Return a copy of the last image with the outlines of its markers and the axes of the frames.

        Args:
            image: Image that was passed to `observe` last.
            observations: What `observe` returned for it.

        Raises:
            InvalidInput: If an argument cannot be used.
        """
        require_type(observations, "observations", dict, "FrameTracker.observe(image, time) returns them")
        detections = detect_markers(image, self.setup.dictionary)
        camera_from_base = self._last_base_from_camera.inverse()
        frames = {
            name: camera_from_base @ each.pose for name, each in observations.items() if each.pose is not None
        }
        return draw_detections(image, self.setup.camera, detections, frames)

    def _require_size(self, image: Array) -> None:
        camera = self.setup.camera
        if image.shape[:2] != (camera.height, camera.width):
            raise InvalidInput(
                f"the image has {image.shape[1]} x {image.shape[0]} pixels, but the camera was calibrated "
                f"with {camera.width} x {camera.height}; calibrate at the size of the images"
            )

    def _base_from_camera(self, detections: Detections) -> Pose | None:
        """Return the pose of the camera in the base; None if its reference marker gives none."""
        if self.setup.reference is None:
            return self.setup.base_from_camera or IDENTITY
        candidates = self._candidates((self.setup.reference,), detections)
        if not candidates or candidates[0].error > self.settings.max_error:
            return None
        poses = [candidate.camera_from_frame.inverse() for candidate in _plausible(candidates)]
        chosen = self._nearest("", poses)
        self._accepted[""] = self._time, poses[chosen]
        return poses[chosen]

    def _candidates(self, markers: Sequence[Marker], detections: Detections) -> tuple[PoseCandidate, ...]:
        return estimate_pose(
            self.setup.camera, markers, detections.corners, max_error=self.settings.max_error
        )

    def _observe_frame(
        self, name: str, detections: Detections, base_from_camera: Pose | None, time: float
    ) -> Observation:
        markers = tuple(marker for marker in self.setup.markers if marker.frame == name)
        candidates = self._candidates(markers, detections)
        if not candidates:
            repeated = any(marker.id in detections.repeated for marker in markers)
            return Observation(None, rejection=Rejection.REPEATED if repeated else Rejection.NOT_FOUND)
        if base_from_camera is None:
            return Observation(None, candidates[0].error, Rejection.REFERENCE)
        if candidates[0].error > self.settings.max_error:
            return Observation(None, candidates[0].error, Rejection.ERROR)
        plausible = _plausible(candidates)
        poses = [base_from_camera @ candidate.camera_from_frame for candidate in plausible]
        chosen = self._nearest(name, poses)
        pose, error = poses[chosen], plausible[chosen].error
        if self._is_jump(name, pose, time):
            return Observation(None, error, Rejection.JUMP)
        ambiguous = len(poses) > 1 and not self._remembers(name)
        self._accepted[name] = time, pose
        return Observation(pose, error, None, ambiguous)

    def _remembers(self, name: str) -> bool:
        return name in self._accepted and self._time - self._accepted[name][0] <= MEMORY

    def _nearest(self, name: str, poses: Sequence[Pose]) -> int:
        """Return the index of the pose nearest to the last accepted one; the first without one."""
        if not self._remembers(name):
            return 0
        last = self._accepted[name][1].quaternion
        return int(np.argmin([angle(last, pose.quaternion) for pose in poses]))

    def _is_jump(self, name: str, pose: Pose, time: float) -> bool:
        if name not in self._accepted:
            return False
        then, last = self._accepted[name]
        distance = float(np.linalg.norm(pose.position - last.position))
        turn = float(angle(last.quaternion, pose.quaternion))
        elapsed = time - then
        settings = self.settings
        return distance > settings.max_speed * elapsed or turn > settings.max_angular_speed * elapsed


def _plausible(candidates: Sequence[PoseCandidate]) -> list[PoseCandidate]:
    """Return the best candidate and those with other orientations that explain the image as well."""
    best = candidates[0]
    limit = max(AMBIGUOUS_FACTOR * best.error, best.error + AMBIGUOUS_ERROR)
    first = best.camera_from_frame.quaternion
    others = [
        candidate
        for candidate in candidates[1:]
        if candidate.error <= limit
        and degrees(float(angle(first, candidate.camera_from_frame.quaternion))) > AMBIGUOUS_ANGLE
    ]
    return [best, *others]
