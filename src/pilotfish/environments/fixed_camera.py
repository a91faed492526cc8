"""Fixed camera with known calibration in a simulated scene, and printed markers on its objects."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, degrees

import mujoco
import numpy as np

from pilotfish.environments.scene_renderer import OffscreenRenderer
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.types import Array, UInt8
from pilotfish.validation import require_count, require_number, require_type, shorten_repr

MAX_IMAGE = 4096  # pixels along one side
THICKNESS = 0.0005  # m, half of the thickness of the plate on which a marker is printed
# MuJoCo's cameras look along -z with y up; ours look along z with y down.
TO_MUJOCO = Pose(np.zeros(3), np.array([0.0, 1.0, 0.0, 0.0]))


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class PrintedMarker:
    """Thin square plate with a picture, fixed to a body; it has no mass and no contacts.

    Attributes:
        name: Name of its geom.
        body: Name of the body; "world" for one that does not move.
        body_from_marker: Pose of the upper face: x right, y up in the picture, z out of it.
        side: Side of the picture [m].
        picture: Grey values; the first row is the upper one.
    """

    name: str
    body: str
    body_from_marker: Pose
    side: float
    picture: UInt8[Array, "S S"]

    def __post_init__(self) -> None:
        """Check size and picture."""
        require_number(self.side, "side", 1e-4, 10.0)
        require_type(self.picture, "picture", np.ndarray, "give an array of uint8")
        if self.picture.ndim != 2 or self.picture.dtype != np.uint8 or len(set(self.picture.shape)) != 1:
            raise InvalidInput(
                f"picture has shape {self.picture.shape} and type {self.picture.dtype}, expected a square of "
                "uint8"
            )


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FixedCamera:
    """Camera without distortion, whose principal point is the middle of the image.

    Attributes:
        world_from_camera: Its pose; x right, y down in the image, z along the view.
        focal_length: Focal length [pixels].
        width: Width of the images [pixels].
        height: Height of the images [pixels].
        name: Name in the model.
    """

    world_from_camera: Pose
    focal_length: float
    width: int = 1280
    height: int = 960
    name: str = "camera"

    def __post_init__(self) -> None:
        """Check the size and the focal length."""
        require_type(self.world_from_camera, "world_from_camera", Pose, "geometry.pose(position, quaternion)")
        require_number(self.focal_length, "focal_length", 1.0, 1e6)
        require_count(self.width, "width", MAX_IMAGE, 1)
        require_count(self.height, "height", MAX_IMAGE, 1)


def add_markers(spec: mujoco.MjSpec, markers: Sequence[PrintedMarker]) -> None:
    """Add printed markers to the bodies of a model.

    Args:
        spec: Model that is extended.
        markers: Markers with different names.

    Raises:
        InvalidInput: If the model has no body of that name.
    """
    for marker in markers:
        body = spec.worldbody if marker.body == "world" else spec.body(marker.body)
        if body is None:
            raise InvalidInput(f"marker {marker.name!r}: the model has no body {marker.body!r}")
        size = len(marker.picture)
        texture = spec.add_texture(
            name=marker.name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=size, height=size, nchannel=3
        )
        texture.data = np.repeat(marker.picture[:, :, None], 3, axis=2).tobytes()
        paper = spec.add_material(name=marker.name, specular=0.0, shininess=0.0)
        paper.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = marker.name
        middle = marker.body_from_marker @ Pose(
            np.array([0.0, 0.0, -THICKNESS]), np.array([1.0, 0.0, 0.0, 0.0])
        )
        plate = body.add_geom(
            name=marker.name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=(marker.side / 2, marker.side / 2, THICKNESS),
            pos=middle.position,
            quat=middle.quaternion,
            material=marker.name,
            mass=0.0,
        )
        plate.contype = plate.conaffinity = 0


def add_camera(spec: mujoco.MjSpec, camera: FixedCamera) -> None:
    """Add a fixed camera to a model, and enlarge the buffer of its images if needed.

    Args:
        spec: Model that is extended.
        camera: Camera.
    """
    pose = camera.world_from_camera @ TO_MUJOCO
    field = degrees(2.0 * atan(0.5 * camera.height / camera.focal_length))
    spec.worldbody.add_camera(name=camera.name, pos=pose.position, quat=pose.quaternion, fovy=field)
    buffer = getattr(spec.visual, "global")
    buffer.offwidth, buffer.offheight = (
        max(buffer.offwidth, camera.width),
        max(buffer.offheight, camera.height),
    )


class FixedCameraRenderer(OffscreenRenderer):
    """Renderer of the images of one fixed camera; it holds graphics memory until it is closed."""

    def __init__(self, model: mujoco.MjModel, camera: FixedCamera) -> None:
        """Create the graphics context.

        Args:
            model: Compiled model, to which `add_camera` added the camera.
            camera: Camera.

        Raises:
            SkillError: If MuJoCo cannot render on this machine.
        """
        super().__init__(model, camera.width, camera.height)
        self._name = camera.name

    def render(self, data: mujoco.MjData) -> UInt8[Array, "H W 3"]:
        """Return an RGB image of the present state.

        Args:
            data: State of the model.
        """
        self._renderer.update_scene(data, self._name)
        return np.asarray(self._renderer.render())
