"""Perform a skill in physics from the frames that a simulated camera sees.

The objects of the task carry printed markers. A fixed camera renders them, with noise, and the frames are
estimated from its images, in the same way as with a real camera. The true frames have no part in it.
Objects at rest are observed before the motion. Moving objects are observed in every period; while one of
their markers is covered the command is held, and after a few seconds the execution stops with the reason.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pilotfish.environments import (
    Failure,
    FixedCameraRenderer,
    Outcome,
    Phase,
    Task,
    Workcell,
    add_camera,
    add_markers,
    stack_measurements,
)
from pilotfish.errors import FramesNotVisible
from pilotfish.geometry import Pose
from pilotfish.models import Skill
from pilotfish.simulation.execution import ExecutionResult, perform
from pilotfish.simulation.marked_tasks import CameraScene, camera_scene
from pilotfish.types import Array, UInt8
from pilotfish.validation import require_count, require_number, require_type, shorten_repr
from pilotfish.vision import FrameTracker, Observation

if TYPE_CHECKING:
    import mujoco

S = TypeVar("S")
ImageFilter = Callable[[UInt8[Array, "H W 3"], float], UInt8[Array, "H W 3"]]
"""Function (image, time) that returns the image for the estimator; the colours are blue, green, red."""


@dataclass(frozen=True, slots=True)
class CameraSimulation:
    """How the images of the simulated camera differ from perfect ones.

    Attributes:
        noise: Standard deviation of each grey value [0 to 255].
        seed: Seed of the noise.
        image_filter: Change of each image, such as a hand before the camera; None for no change.
    """

    noise: float = 2.0
    seed: int = 0
    image_filter: ImageFilter | None = None

    def __post_init__(self) -> None:
        """Check all values."""
        require_number(self.noise, "noise", 0.0, 255.0)
        require_count(self.seed, "seed", 2**63)


DEFAULT_SIMULATION = CameraSimulation()


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class CameraExecution:
    """Result of a skill that was performed from the frames of a camera.

    Attributes:
        execution: Result as that of `perform`; its frames are those of the camera.
        true_frames: True poses of the frames at the start.
        images: Number of images that were taken.
        lost_images: Number of images in which a frame was not visible, during which the robot waited.
    """

    execution: ExecutionResult
    true_frames: dict[str, Pose]
    images: int
    lost_images: int


class CameraObserver:
    """Estimator of the frames of a workcell from the images of its camera.

    Attributes:
        scene: Markers and camera.
        images: Number of images taken so far.
        lost_images: Number of them in which a frame was not visible.
    """

    def __init__(self, scene: CameraScene, simulation: CameraSimulation = DEFAULT_SIMULATION) -> None:
        """Start without an image.

        Args:
            scene: Markers and camera, from `camera_scene`.
            simulation: How images differ from perfect ones.

        Raises:
            InvalidInput: If an argument has another type.
        """
        require_type(scene, "scene", CameraScene, "camera_scene(task, situation) creates one")
        require_type(simulation, "simulation", CameraSimulation, "CameraSimulation() creates one")
        self.scene, self.images, self.lost_images = scene, 0, 0
        self._simulation, self._rng = simulation, np.random.default_rng(simulation.seed)
        self._tracker = FrameTracker(scene.setup)
        self._renderer: FixedCameraRenderer | None = None
        self._last: tuple[float, dict[str, Observation]] | None = None

    def close(self) -> None:
        """Release the graphics memory."""
        if self._renderer:
            self._renderer.close()
        self._renderer = None

    def observe(self, model: "mujoco.MjModel", data: "mujoco.MjData") -> dict[str, Pose]:
        """Return the pose of each frame in an image of the present state, in torso axes.

        Args:
            model: Compiled model with the markers and the camera.
            data: State of the model.

        Raises:
            FramesNotVisible: If a frame is not visible or its pose was rejected.
        """
        time = float(data.time)
        if self._last is None or self._last[0] != time:
            observations = self._tracker.observe(self._take_image(model, data), time)
            self._last = time, observations
            self.images += 1
            self.lost_images += any(each.pose is None for each in observations.values())
        poses = {name: each.pose for name, each in self._last[1].items()}
        for name, pose in poses.items():
            if pose is None:
                reason = self._last[1][name].rejection
                raise FramesNotVisible(
                    f"the camera does not see frame {name!r} at {time:.2f} s ({reason}); uncover its marker, "
                    "or move the camera"
                )
        return {name: pose for name, pose in poses.items() if pose is not None}

    def _take_image(self, model: "mujoco.MjModel", data: "mujoco.MjData") -> UInt8[Array, "H W 3"]:
        if self._renderer is None:
            self._renderer = FixedCameraRenderer(model, self.scene.camera)
        image = self._renderer.render(data)[:, :, ::-1]
        if self._simulation.noise:
            noise = self._rng.standard_normal(image.shape, dtype=np.float32) * np.float32(
                self._simulation.noise
            )
            image = np.clip(image + noise, 0.0, 255.0).astype(np.uint8)
        image = np.ascontiguousarray(image)
        change = self._simulation.image_filter
        return image if change is None else change(image, float(data.time))


def marked_task(task: Task[S], scene: CameraScene, observer: CameraObserver) -> Task[S]:
    """Return a task with markers on its objects, whose frames are those that its camera sees.

    Args:
        task: Task from `TASKS`.
        scene: Markers and camera, from `camera_scene`.
        observer: Estimator of the frames.
    """
    require_type(task, "task", Task, "take one from TASKS")

    def add_objects(spec: "mujoco.MjSpec", situation: S) -> None:
        task.add_objects(spec, situation)
        add_markers(spec, scene.printed)
        add_camera(spec, scene.camera)

    def observe_frames(model: "mujoco.MjModel", data: "mujoco.MjData", situation: S) -> dict[str, Pose]:
        del situation
        return observer.observe(model, data)

    return replace(task, add_objects=add_objects, observe_frames=observe_frames)


def perform_from_camera(
    skill: Skill,
    task: Task[S],
    situation: S,
    *,
    simulation: CameraSimulation = DEFAULT_SIMULATION,
    on_period: Callable[[Workcell[S]], None] | None = None,
    **options: Any,
) -> CameraExecution:
    """Perform a skill in physics from the frames that a simulated camera sees.

    Args:
        skill: Skill learned from recordings of the task, with derivatives.
        task: Task from `TASKS` that has markers.
        situation: Situation of the task.
        simulation: How the images of the camera differ from perfect ones.
        on_period: As `perform`.
        options: Other keyword arguments of `perform`.

    Returns:
        The result of `perform`. If a frame is not visible before the motion, or for too long during it, the
        execution stops there and its failure says which.

    Raises:
        InvalidInput: As `perform`, and if the task has no markers.
    """
    true_cell = Workcell(task, situation)
    scene = camera_scene(task, situation)
    observer = CameraObserver(scene, simulation)
    log = _PeriodLog(on_period)
    try:
        execution = perform(
            skill, marked_task(task, scene, observer), situation, on_period=log.record, **options
        )
    except FramesNotVisible as lost:
        execution = log.stopped_result(str(lost), true_cell)
    finally:
        observer.close()
    return CameraExecution(execution, true_cell.frames(), observer.images, observer.lost_images)


class _PeriodLog:
    """What was commanded and measured in each period, for an execution that stops early."""

    def __init__(self, on_period: Callable[[Workcell[Any]], None] | None) -> None:
        self._on_period = on_period
        self._rows: list[tuple[Pose, Pose, float]] = []
        self._progress: list[Any] = []
        self._cell: Workcell[Any] | None = None

    def record(self, cell: Workcell[Any]) -> None:
        """Record a period, and pass the workcell on."""
        self._cell = cell
        self._rows.append((cell.target, cell.arm.tool, cell.forces["tool"]))
        self._progress.append(cell.measure_progress())
        if self._on_period:
            self._on_period(cell)

    def stopped_result(self, reason: str, start: Workcell[Any]) -> ExecutionResult:
        """Return the result of the periods before the stop; start is a workcell at the start."""
        cell = self._cell or start
        failure = Failure(
            Phase.MOTION if self._cell else Phase.APPROACH, "stopped, a frame is not visible", reason
        )
        commanded, measured = (
            np.array([np.append(pose.position, pose.quaternion) for pose in poses]).reshape(-1, 7)
            for poses in ([row[0] for row in self._rows], [row[1] for row in self._rows])
        )
        return ExecutionResult(
            Outcome(False, cell.outcome().error, reason),
            commanded,
            measured,
            np.array([row[2] for row in self._rows]),
            dict(cell.peak_forces),
            cell.time,
            start.frames(),
            stack_measurements(self._progress),
            failure,
        )
