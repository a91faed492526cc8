"""Where markers sit on the objects of the simulated tasks, and where the camera stands."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pilotfish.environments import FixedCamera, PrintedMarker, Task, Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, quaternion_from_rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, shorten_repr
from pilotfish.vision import DEFAULT_DICTIONARY, Camera, Marker, MarkerSetup, marker_bitmap

FOCAL_LENGTH = 1100.0  # pixels: a field of view of 60 degrees in 1280 pixels
CELL_PIXELS = 16  # of the picture of a marker
Triple = tuple[float, float, float]


@shorten_repr
@dataclass(frozen=True, slots=True)
class MarkedFrame:
    """Markers of one frame of a task.

    Attributes:
        frame: Name of the frame.
        body: Name of the body to which the markers are fixed; "world" for one that does not move.
        side: Side of each black square [m].
        centres: Centre of each marker in the axes of the frame [m].
        right: Direction of the markers' x axis in the frame, a unit vector along an axis.
        up: Direction of the markers' y axis in the frame.
    """

    frame: str
    body: str
    side: float
    centres: tuple[Triple, ...]
    right: Triple = (1.0, 0.0, 0.0)
    up: Triple = (0.0, 1.0, 0.0)

    def marker_poses(self) -> list[Pose]:
        """Return the pose of each marker in the axes of the frame."""
        x, y = np.array(self.right), np.array(self.up)
        quaternion = quaternion_from_rotation_matrix(np.stack([x, y, np.cross(x, y)], axis=1))
        return [Pose(np.array(centre), quaternion) for centre in self.centres]


@shorten_repr
@dataclass(frozen=True, slots=True)
class MarkedTask:
    """Markers of a task, and the place of its camera.

    Attributes:
        frames: Markers of each frame.
        eye: Position of the camera in torso axes [m].
        look_at: Point in the middle of its image [m].
    """

    frames: tuple[MarkedFrame, ...]
    eye: Triple
    look_at: Triple

    def camera(self) -> FixedCamera:
        """Return the camera of the task."""
        return FixedCamera(_look(np.array(self.eye), np.array(self.look_at)), FOCAL_LENGTH)


def _square(half_x: float, half_y: float, z: float = 0.0) -> tuple[Triple, ...]:
    return tuple((sx * half_x, sy * half_y, z) for sx, sy in ((-1, 1), (1, 1), (1, -1), (-1, -1)))


def _ring(radius: float, x: float) -> tuple[Triple, ...]:
    """Return four points around the x axis."""
    return ((x, radius, 0.0), (x, 0.0, radius), (x, -radius, 0.0), (x, 0.0, -radius))


# The markers of the valve face the robot: x of the frame points away from it.
FACING_ROBOT: dict[str, Any] = {"right": (0.0, -1.0, 0.0), "up": (0.0, 0.0, 1.0)}
MARKED_TASKS: Mapping[str, MarkedTask] = {
    # A plate behind the handle turns with it. A ring on the panel is set to the goal.
    "valve": MarkedTask(
        (
            MarkedFrame(
                "before",
                "valve",
                0.03,
                tuple((0.03, y, z) for y, z, _ in _square(0.045, 0.045)),
                **FACING_ROBOT,
            ),
            MarkedFrame("after", "stand", 0.04, _ring(0.125, 0.066), **FACING_ROBOT),
        ),
        eye=(0.2, 0.12, 0.75),
        look_at=(0.86, -0.3, 0.12),
    ),
    "plate": MarkedTask(
        (
            MarkedFrame("plate", "plate", 0.028, _square(0.05, 0.03, 0.001)),
            MarkedFrame(
                "obstacle",
                "world",
                0.03,
                tuple((x, 0.0, 0.016) for x in (-0.13, -0.045, 0.045, 0.13)),
            ),
        ),
        eye=(1.3, -0.45, 0.65),
        look_at=(0.66, -0.38, 0.0),
    ),
    # A tray around the block moves with it.
    "screwdriver": MarkedTask(
        (MarkedFrame("target", "target", 0.035, _square(0.055, 0.055)),),
        eye=(1.25, -0.15, 0.6),
        look_at=(0.66, -0.32, -0.05),
    ),
    # The panel behind the receptacle faces the robot: z of the frame points into the bore.
    "stab": MarkedTask(
        (MarkedFrame("receptacle", "receptacle", 0.04, _square(0.075, 0.1, 0.085), up=(0.0, -1.0, 0.0)),),
        eye=(0.3, 0.1, 0.7),
        look_at=(0.86, -0.38, 0.0),
    ),
}


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class CameraScene:
    """Markers and camera of a task in one situation.

    Attributes:
        setup: What the estimator knows: ids, sides, places on the objects, and the calibration.
        printed: Markers to add to the model.
        camera: Camera to add to the model.
    """

    setup: MarkerSetup
    printed: tuple[PrintedMarker, ...]
    camera: FixedCamera


def camera_scene(task: Task[Any], situation: Any) -> CameraScene:
    """Return the markers of a task and its camera.

    Args:
        task: Task from `TASKS` that has markers.
        situation: Situation of the task; it decides where the goal marks are.

    Raises:
        InvalidInput: If no markers are defined for the task.
    """
    require_type(task, "task", Task, "take one from TASKS")
    if task.name not in MARKED_TASKS:
        raise InvalidInput(
            f"task {task.name!r} has no markers, expected one of {', '.join(MARKED_TASKS)}; perform it "
            "without a camera"
        )
    marked, cell = MARKED_TASKS[task.name], Workcell(task, situation)
    true_frames = cell.frames()
    markers: list[Marker] = []
    printed: list[PrintedMarker] = []
    for each in marked.frames:
        body_from_frame = _world_from_body(cell, each.body).inverse() @ true_frames[each.frame]
        for frame_from_marker in each.marker_poses():
            number = len(markers)
            markers.append(Marker(number, each.side, each.frame, frame_from_marker.inverse()))
            printed.append(_print_marker(number, each, body_from_frame @ frame_from_marker))
    camera = marked.camera()
    setup = MarkerSetup(
        DEFAULT_DICTIONARY, tuple(markers), calibration(camera), base_from_camera=camera.world_from_camera
    )
    return CameraScene(setup, tuple(printed), camera)


def calibration(camera: FixedCamera) -> Camera:
    """Return the exact calibration of a simulated camera.

    Args:
        camera: Camera without distortion.
    """
    require_type(camera, "camera", FixedCamera, "FixedCamera(pose, focal_length) creates one")
    f = camera.focal_length
    return Camera(camera.width, camera.height, f, f, (camera.width - 1) / 2, (camera.height - 1) / 2)


def _print_marker(number: int, marked: MarkedFrame, body_from_marker: Pose) -> PrintedMarker:
    bitmap = marker_bitmap(DEFAULT_DICTIONARY, number, CELL_PIXELS)
    picture = np.pad(bitmap, CELL_PIXELS, constant_values=255)  # a white margin of one cell
    side = marked.side * len(picture) / len(bitmap)
    return PrintedMarker(f"marker_{number}", marked.body, body_from_marker, side, picture)


def _world_from_body(cell: Workcell[Any], name: str) -> Pose:
    body = cell.data.body(name)
    return Pose(np.array(body.xpos), np.array(body.xquat))


def _look(eye: Float[Array, " 3"], target: Float[Array, " 3"]) -> Pose:
    """Return the pose of a camera that looks at a point, with the vertical upright in its image."""
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, np.array([0.0, 0.0, 1.0]))
    right /= np.linalg.norm(right)
    return Pose(
        eye, quaternion_from_rotation_matrix(np.stack([right, np.cross(ahead, right), ahead], axis=1))
    )
