"""Calibration from projected corners with known intrinsics, and from a warped picture of a board."""

import cv2
import numpy as np
import pytest
from marker_images import CAMERA, draw_plane, facing_pose

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.vision import BoardView, CalibrationBoard, Camera, calibrate_camera, find_board, project

TRUE = Camera(640, 480, 620.0, 615.0, 325.0, 236.0, (-0.15, 0.05, 0.001, -0.0005, 0.0))
COLUMNS, ROWS, SQUARE = 9, 6, 0.03


def view(pose: Pose, noise: float, rng: np.random.Generator) -> BoardView:
    column, row = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS))
    points = SQUARE * np.stack([column.ravel(), row.ravel(), np.zeros(row.size)], axis=1)
    middle = points - points.mean(axis=0)
    pixels = project(TRUE, middle @ rotation_matrix(pose.quaternion).T + pose.position)
    return BoardView(points, pixels + rng.normal(0.0, noise, pixels.shape))


def tilted_views(rng: np.random.Generator, tilt: float, noise: float = 0.1) -> list[BoardView]:
    return [
        view(facing_pose((*rng.uniform(-0.08, 0.08, 2), 0.55), tilt, axis, axis), noise, rng)
        for axis in np.linspace(0.0, 6.0, 10)
    ]


def test_known_intrinsics_are_recovered(rng: np.random.Generator):
    found = calibrate_camera(tilted_views(rng, 0.6), 640, 480)
    assert found.views == 10
    assert found.rms_error == pytest.approx(0.1 * 2**0.5, rel=0.15)
    for name in ("fx", "fy", "cx", "cy"):
        assert getattr(found.camera, name) == pytest.approx(getattr(TRUE, name), abs=4.0), name
    assert abs(found.camera.fx - TRUE.fx) < 5.0 * found.focal_deviation[0]
    assert found.largest_tilt == pytest.approx(np.degrees(1.2), abs=6.0)


def test_parallel_views_are_refused(rng: np.random.Generator):
    with pytest.raises(InvalidInput, match="do not determine the camera"):
        calibrate_camera(tilted_views(rng, 0.0), 640, 480)
    same = [view(facing_pose((0.0, 0.0, 0.5), 0.5), 0.1, rng)] * 6
    with pytest.raises(InvalidInput, match="do not determine the camera"):
        calibrate_camera(same, 640, 480)


def test_few_or_broken_views_are_refused(rng: np.random.Generator):
    views = tilted_views(rng, 0.6)
    with pytest.raises(InvalidInput, match="expected 4"):
        calibrate_camera(views[:3], 640, 480)
    broken = [*views[:4], BoardView(np.full((54, 3), np.nan), np.zeros((54, 2)))]
    with pytest.raises(InvalidInput, match="view 4: points"):
        calibrate_camera(broken, 640, 480)
    with pytest.raises(InvalidInput, match="view 0"):
        calibrate_camera([BoardView(np.zeros((2, 3)), np.zeros((2, 2)))] * 5, 640, 480)


def test_corners_of_a_warped_chessboard_are_found():
    squares = np.indices((ROWS + 1, COLUMNS + 1)).sum(axis=0) % 2 * 255
    picture = np.kron(squares, np.ones((20, 20))).astype(np.uint8)
    picture = np.pad(picture, 20, constant_values=255)
    pose = facing_pose((0.02, 0.0, 0.6), 0.5, 0.8, 0.1)
    image = draw_plane(
        np.full((480, 640), 255, np.uint8), picture, picture.shape[1] / 20 * SQUARE, CAMERA, pose
    )
    found = find_board(image, CalibrationBoard(COLUMNS, ROWS, SQUARE))
    assert found is not None
    assert found.points.shape == (54, 3)
    matrix = CAMERA.matrix
    _, turn, shift = cv2.solvePnP(found.points, found.pixels, matrix, None)
    again, _ = cv2.projectPoints(found.points, turn, shift, matrix, None)
    assert np.abs(again[:, 0] - found.pixels).max() < 0.1
    assert float(np.linalg.norm(shift)) == pytest.approx(0.6, abs=0.15)
    assert find_board(np.zeros((480, 640), np.uint8), CalibrationBoard(COLUMNS, ROWS, SQUARE)) is None


def test_corners_of_a_charuco_board_are_found():
    board = CalibrationBoard(7, 5, 0.04, 0.03)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    picture = cv2.aruco.CharucoBoard((7, 5), 0.04, 0.03, dictionary).generateImage((560, 400))
    image = draw_plane(
        np.full((480, 640), 255, np.uint8), picture, 0.28, CAMERA, facing_pose((0.0, 0.0, 0.5), 0.3)
    )
    found = find_board(image, board)
    assert found is not None
    assert len(found.points) == 24


@pytest.mark.parametrize(
    "values", [(2, 6, 0.03), (9, 99, 0.03), (9, 6, -1.0), (9, 6, np.nan), (9, 6, 0.03, 0.03)]
)
def test_unusable_board_is_invalid_input(values):
    with pytest.raises(InvalidInput):
        CalibrationBoard(*values)
