"""Fixed camera: what it renders lies where the pinhole camera projects it."""

import mujoco
import numpy as np
import pytest
from drawing import needs_renderer

from pilotfish.environments import FixedCamera, FixedCameraRenderer, PrintedMarker, add_camera, add_markers
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector

HERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def scene(picture: np.ndarray, marker: Pose, camera: FixedCamera) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    light = spec.worldbody.add_light(dir=(0.0, 0.0, 1.0), diffuse=[1.0] * 3, castshadow=False)
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_body(name="board", pos=marker.position, quat=marker.quaternion)
    add_markers(spec, [PrintedMarker("m", "board", HERE, 0.2, picture)])
    add_camera(spec, camera)
    return spec.compile()


@needs_renderer
def test_quarters_of_a_picture_lie_where_they_are_projected():
    picture = np.zeros((64, 64), dtype=np.uint8)
    picture[:32, :32] = 255  # upper left
    camera = FixedCamera(Pose(np.zeros(3), from_rotation_vector(np.array([0.0, 0.1, 0.0]))), 300.0, 320, 240)
    facing = Pose(np.array([0.2, 0.05, 1.0]), np.array([0.0, 1.0, 0.0, 0.0]))  # z towards the camera
    model = scene(picture, facing, camera)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with FixedCameraRenderer(model, camera) as renderer:
        image = renderer.render(data)
    assert image.shape == (240, 320, 3)
    for x, y, bright in (
        (-0.05, 0.05, True),
        (0.05, 0.05, False),
        (-0.05, -0.05, False),
        (0.05, -0.05, False),
    ):
        world = np.array([0.2 + x, 0.05 - y, 1.0])  # the facing marker's y axis points along -y
        c, s = np.cos(0.1), np.sin(0.1)
        X, Z = c * world[0] - s * world[2], s * world[0] + c * world[2]
        column, row = 300.0 * X / Z + 159.5, 300.0 * world[1] / Z + 119.5
        assert (image[round(row), round(column)].mean() > 150) == bright, (x, y)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_unusable_markers_and_cameras_are_invalid_input():
    for picture in (np.zeros((3, 4), np.uint8), np.zeros((4, 4)), None):
        with pytest.raises(InvalidInput, match="picture"):
            PrintedMarker("m", "world", HERE, 0.1, picture)
    with pytest.raises(InvalidInput, match="side"):
        PrintedMarker("m", "world", HERE, np.nan, np.zeros((4, 4), np.uint8))
    for values in ((0.0, 10, 10), (300.0, 0, 10), (300.0, 10, 10**6)):
        with pytest.raises(InvalidInput):
            FixedCamera(HERE, *values)
    with pytest.raises(InvalidInput, match="no body 'missing'"):
        add_markers(mujoco.MjSpec(), [PrintedMarker("m", "missing", HERE, 0.1, np.zeros((4, 4), np.uint8))])
