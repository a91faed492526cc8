"""Pinhole camera: projection against OpenCV, a finite difference, and its file."""

import cv2
import numpy as np
import pytest

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.vision import Camera, project, read_camera, write_camera

DISTORTION = (0.1, -0.05, 0.001, -0.002, 0.01, 0.02, 0.003, 0.004)


@pytest.mark.parametrize("count", [0, 4, 5, 8])
def test_projection_equals_opencv(count: int, rng: np.random.Generator):
    camera = Camera(640, 480, 600.0, 590.0, 310.0, 250.0, DISTORTION[:count])
    points = rng.uniform([-0.3, -0.3, 0.6], [0.3, 0.3, 2.0], (50, 3))
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, np.array(DISTORTION[:count])
    )
    np.testing.assert_allclose(project(camera, points), expected[:, 0], atol=1e-9)


def test_projection_without_distortion_scales_with_focal_length_over_depth():
    camera = Camera(640, 480, 600.0, 500.0, 320.0, 240.0)
    move = project(camera, np.array([[0.011, 0.02, 2.0]])) - project(camera, np.array([[0.01, 0.02, 2.0]]))
    np.testing.assert_allclose(move, [[0.001 * 600.0 / 2.0, 0.0]], atol=1e-9)


def test_projection_of_a_point_behind_the_camera_is_nan():
    pixels = project(
        Camera(640, 480, 600.0, 600.0, 320.0, 240.0), np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    )
    assert np.isnan(pixels[0]).all()
    np.testing.assert_allclose(pixels[1], [320.0, 240.0])


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    "change",
    [
        {"width": 0}, {"width": 2.5}, {"height": 10**9}, {"fx": 0.0}, {"fx": -3.0}, {"fy": np.nan},
        {"cx": np.inf}, {"cy": "3"}, {"distortion": (0.1,)}, {"distortion": (np.nan,) * 5},
        {"distortion": "abcd"}, {"distortion": None},
    ],
)  # fmt: skip
def test_camera_refuses_unusable_values(change: dict):
    values = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0, **change}
    with pytest.raises(InvalidInput, match=next(iter(change))):
        Camera(**values)


def test_camera_file_restores_every_number(tmp_path):
    camera = Camera(1280, 720, 1101.123456789, 1 / 3 * 1e3, 640.1, 359.9, (0.1, -0.2, 1e-17, 0.0, 0.3))
    write_camera(tmp_path / "camera.toml", camera, rms_error=0.25, views=12)
    assert read_camera(tmp_path / "camera.toml") == camera
    with pytest.raises(SkillError, match="exists"):
        write_camera(tmp_path / "camera.toml", camera, rms_error=0.25, views=12)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("fx = ", "focal = "), "unknown key 'focal'"),
        (("fx = 600.0\n", ""), "'fx' is missing"),
        (("fy = 600.0", "fyy = 600.0"), "did you mean 'fy'"),
        (("width = 640", "width = nan"), "width"),
        (("pilotfish camera", "pilotfish markers"), "expected format"),
        (("version = 1", "version = 99"), "newer version"),
        (("distortion = [", "distortion = 3 #"), "distortion"),
        (("cy = ", "cy"), "not TOML"),
    ],
)
def test_damaged_camera_file_is_explained(tmp_path, edit: tuple[str, str], message: str):
    file = tmp_path / "camera.toml"
    write_camera(file, Camera(640, 480, 600.0, 600.0, 320.0, 240.0), rms_error=0.1, views=9)
    text = file.read_text()
    assert edit[0] in text
    file.write_text(text.replace(edit[0], edit[1], 1))
    with pytest.raises(InvalidInput, match=message):
        read_camera(file)


def test_missing_binary_and_empty_camera_files_are_invalid_input(tmp_path):
    (tmp_path / "binary").write_bytes(bytes(range(256)))
    (tmp_path / "empty").write_bytes(b"")
    for name in ("missing", "binary", "empty", "."):
        with pytest.raises(SkillError):
            read_camera(tmp_path / name)
