"""Offscreen rendering of a simulated scene, with drawings in the image."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import TracebackType
from typing import TypeVar
from warnings import catch_warnings
from weakref import finalize

import mujoco
import numpy as np

from pilotfish.environments.scene_drawings import (
    Ellipsoid,
    ToolCopy,
    draw_ellipsoids,
    draw_frames,
    draw_path,
    draw_tool_copies,
)
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float, UInt8

WIDTH, HEIGHT = 640, 480
REMEDY = (
    "pip install '.[sim]' in the clone, apt-get install libosmesa6, "
    "and set MUJOCO_GL=osmesa before Python starts"
)
NO_FRAMES: Mapping[str, Pose] = {}
NO_PATH = np.zeros((0, 3))


@dataclass(frozen=True, slots=True)
class CameraView:
    """Position and direction of the camera.

    Attributes:
        look_at: Point in the middle of the image, in torso axes [m].
        distance: Distance of the camera from that point [m].
        azimuth: Direction of view about the vertical [degrees]; 0 looks ahead of the robot, 90 to its left.
        elevation: Direction of view above the horizontal [degrees]; negative values look down.
    """

    look_at: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float


# From the right of the robot: tool and object are visible, and no panel hides them.
FRONT_RIGHT = CameraView((0.66, -0.28, 0.05), 1.4, 75.0, -22.0)


R = TypeVar("R", bound="OffscreenRenderer")


class OffscreenRenderer:
    """Graphics context of one model; it holds graphics memory until it is closed."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        """Create the context.

        Args:
            model: Compiled model.
            width: Width of the images [pixels].
            height: Height of the images [pixels].

        Raises:
            SkillError: If MuJoCo cannot render on this machine.
        """
        if reason := rendering_error():
            raise SkillError(f"MuJoCo cannot render on this machine ({reason}): {REMEDY}")
        self._renderer = mujoco.Renderer(model, height, width)
        self._finalizer = finalize(self, self._renderer.close)  # at the latest before the interpreter ends

    def __enter__(self: R) -> R:
        """Return this renderer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the graphics memory."""
        self.close()

    def close(self) -> None:
        """Release the graphics memory; the renderer cannot be used afterwards."""
        self._finalizer()


class SceneRenderer(OffscreenRenderer):
    """Renderer of one model from one view; it holds graphics memory until it is closed."""

    def __init__(
        self,
        model: mujoco.MjModel,
        view: CameraView = FRONT_RIGHT,
        *,
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        """Create the graphics context.

        Args:
            model: Compiled model.
            view: Position and direction of the camera.
            width: Width of the images [pixels].
            height: Height of the images [pixels].

        Raises:
            InvalidInput: If the size is not positive or larger than the model's offscreen buffer.
            SkillError: If MuJoCo cannot render on this machine.
        """
        size = model.vis.global_
        if not (0 < width <= size.offwidth and 0 < height <= size.offheight):
            raise InvalidInput(
                f"the image size is {width} x {height}, expected 1 x 1 to {size.offwidth} x "
                f"{size.offheight} pixels; choose a smaller one"
            )
        self._model, self._camera = model, _free_camera(view)
        super().__init__(model, width, height)

    def render(
        self,
        data: mujoco.MjData,
        *,
        frames: Mapping[str, Pose] = NO_FRAMES,
        path: Float[Array, "T 3"] = NO_PATH,
        ellipsoids: Sequence[Ellipsoid] = (),
        tool_copies: Sequence[ToolCopy] = (),
        view: CameraView | None = None,
    ) -> UInt8[Array, "H W 3"]:
        """Return an RGB image of the present state.

        Args:
            data: State of the model.
            frames: Poses that are drawn as red, green and blue axes, in torso axes.
            path: Points of a path that is drawn in orange, in torso axes [m].
            ellipsoids: Translucent ellipsoids.
            tool_copies: Translucent copies of a tool at other poses.
            view: Position and direction of the camera from this image on; None leaves it.
        """
        if view:
            self._camera = _free_camera(view)
        self._renderer.update_scene(data, self._camera)
        scene = self._renderer.scene
        draw_tool_copies(self._model, data, scene, tool_copies)
        draw_frames(scene, frames)
        draw_path(scene, path)
        draw_ellipsoids(scene, ellipsoids)
        return np.asarray(self._renderer.render())


@cache  # MuJoCo aborts the process when it fails a second time
def rendering_error() -> str:
    """Return why MuJoCo cannot render in this process, or an empty string if it can."""
    try:
        with catch_warnings(action="ignore"):  # warnings about a missing display; the error is enough
            mujoco.Renderer(mujoco.MjSpec().compile(), 1, 1).close()
    except (ImportError, RuntimeError, AttributeError, mujoco.FatalError) as error:
        return str(error)
    return ""


def _free_camera(view: CameraView) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat[:] = view.look_at
    camera.distance, camera.azimuth, camera.elevation = view.distance, view.azimuth, view.elevation
    return camera
