"""Pictures of the physics: from where one looks at each task, and what may be drawn into them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from types import MappingProxyType, TracebackType
from warnings import catch_warnings
from weakref import finalize

import mujoco
import numpy as np

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float, UInt8

WIDTH, HEIGHT = 640, 480
REMEDY = (
    "pip install 'pilotfish[sim]', apt-get install libosmesa6, and set MUJOCO_GL=osmesa before Python starts"
)
AXIS, AXIS_RADIUS, PATH_RADIUS = 0.06, 0.003, 0.003  # m
MAX_PATH_SEGMENTS = 400  # of a path at most: more are not to be told apart
AXES = np.array(
    [[0.85, 0.1, 0.1, 1.0], [0.1, 0.65, 0.15, 1.0], [0.15, 0.3, 0.9, 1.0]]
)  # x red, y green, z blue
ORANGE = np.array([0.95, 0.5, 0.05, 1.0])


@dataclass(frozen=True, slots=True)
class CameraView:
    """From where one looks: at a point [m], from a distance [m], in a direction [degrees].

    Azimuth 0 looks ahead as the robot does and 90 to its left; a negative elevation looks down.
    """

    at: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float


# From the robot's right, so that tool and thing are seen, and no panel hides them.
FRONT_RIGHT = CameraView((0.66, -0.28, 0.05), 1.4, 75.0, -22.0)
CAMERA_VIEWS: Mapping[str, CameraView] = MappingProxyType(
    {
        "carabiner": CameraView((0.66, -0.3, 0.1), 1.05, 95.0, -18.0),
        "plate": CameraView((0.66, -0.3, 0.1), 1.2, 75.0, -25.0),
        "recorded valve": CameraView((0.55, -0.95, 0.2), 1.15, 28.0, -14.0),
        "screwdriver": CameraView((0.66, -0.3, 0.07), 1.05, 80.0, -22.0),
        "stab": CameraView((0.66, -0.28, 0.07), 1.3, 65.0, -20.0),
        "valve": CameraView((0.68, -0.3, 0.12), 1.25, 62.0, -18.0),
    }
)


def camera_view(task: str) -> CameraView:
    """From where a task of that name is seen well; any other is seen as a whole."""
    return CAMERA_VIEWS.get(task, FRONT_RIGHT)


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """What is drawn into a picture though it is not there: frames as axes red, green, blue; a path [m]."""

    frames: Mapping[str, Pose] = field(default_factory=lambda: MappingProxyType({}))
    path: Float[Array, "T 3"] = field(default_factory=lambda: np.zeros((0, 3)))


EMPTY_OVERLAY = Overlay()


class SceneRenderer:
    """Takes pictures of a model from a view. Each holds memory of the graphics until it is closed.

    Raises: InvalidInput, when pictures of this size are not to be had; SkillError, when nothing draws here.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        view: CameraView = FRONT_RIGHT,
        *,
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        size = model.vis.global_
        if not (0 < width <= size.offwidth and 0 < height <= size.offheight):
            raise InvalidInput(
                f"pictures of {width} x {height} were asked for, expected from 1 x 1 to "
                f"{size.offwidth} x {size.offheight}; ask for smaller ones"
            )
        self._camera = _camera(view)
        if reason := rendering_error():
            raise SkillError(f"nothing draws pictures of the physics here ({reason}): {REMEDY}")
        self._renderer = mujoco.Renderer(model, height, width)
        self._finalizer = finalize(self, self._renderer.close)  # at the latest before the interpreter ends

    def __enter__(self) -> "SceneRenderer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Nothing is held any more, and no picture taken."""
        self._finalizer()

    def render(self, data: mujoco.MjData, overlay: Overlay = EMPTY_OVERLAY) -> UInt8[Array, "H W 3"]:
        """The picture of what is there now, red, green, blue; with marks drawn into it."""
        self._renderer.update_scene(data, self._camera)
        _add_overlay(self._renderer.scene, overlay)
        return np.asarray(self._renderer.render())


@cache  # MuJoCo ends the process when it fails a second time
def rendering_error() -> str:
    """What keeps MuJoCo from drawing pictures in this process; empty when it draws."""
    try:
        with catch_warnings(action="ignore"):  # of what looks for a screen; the error tells enough
            mujoco.Renderer(mujoco.MjSpec().compile(), 1, 1).close()
    except (ImportError, RuntimeError, AttributeError, mujoco.FatalError) as error:
        return str(error)
    return ""


def _camera(view: CameraView) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat[:] = view.at
    camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
    return camera


def _add_overlay(scene: mujoco.MjvScene, overlay: Overlay) -> None:
    for pose in overlay.frames.values():
        ends = pose.position + AXIS * rotation_matrix(pose.quaternion).T
        for end, colour in zip(ends, AXES, strict=True):
            _add_capsule(scene, (pose.position, end), AXIS_RADIUS, colour)
    for begin, end in pairwise(_subsample_path(overlay.path)):
        _add_capsule(scene, (begin, end), PATH_RADIUS, ORANGE)


def _subsample_path(path: Float[Array, "T 3"]) -> Float[Array, "L 3"]:
    """Points of the path from its first to its last, no more than make so many links."""
    kept = np.linspace(0, len(path) - 1, min(len(path), MAX_PATH_SEGMENTS + 1)).round().astype(int)
    return np.asarray(path[kept])


def _add_capsule(
    scene: mujoco.MjvScene,
    ends: tuple[Float[Array, " 3"], Float[Array, " 3"]],
    radius: float,
    colour: Float[Array, " 4"],
) -> None:
    """A capsule from end to end, unless the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom, kind = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_CAPSULE
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), colour.astype(np.float32))
    mujoco.mjv_connector(geom, kind, radius, *ends)
    geom.category, geom.emission = mujoco.mjtCatBit.mjCAT_DECOR, 0.4
    scene.ngeom += 1
