"""Poses from synthetic corners with a known pose, and from warped images."""

import numpy as np
import pytest
from marker_images import CAMERA, DICTIONARY, UNIT, facing_pose, marker_image, marker_pixels

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, from_rotation_vector
from pilotfish.vision import Camera, Marker, detect_markers, estimate_pose, project
from pilotfish.vision.pose_estimation import PoseCandidate

HERE = Pose(np.zeros(3), UNIT)
BOARD = tuple(
    Marker(n, 0.05, "board", Pose(np.array([x, y, z]), from_rotation_vector(np.array(turn))))
    for n, (x, y, z, turn) in enumerate(
        [(0.06, 0.05, 0.0, [0, 0, 0]), (-0.07, 0.04, 0.01, [0.0, 0.4, 0]), (0.05, -0.06, 0.0, [0, 0, 1.2])]
    )
)
DISTORTED = Camera(640, 480, 600.0, 610.0, 315.0, 243.0, (-0.2, 0.08, 0.002, -0.001, 0.01))


def distorted_corners(marker: Marker, pose: Pose) -> np.ndarray:
    R = np.array([np.asarray((pose @ Pose(axis, UNIT)).position - pose.position) for axis in np.eye(3)]).T
    return project(DISTORTED, marker.corners_in_frame @ R.T + pose.position)


def errors(candidate: PoseCandidate, true: Pose) -> tuple[float, float]:
    estimate = candidate.camera_from_frame
    return (
        float(np.linalg.norm(estimate.position - true.position)),
        float(angle(estimate.quaternion, true.quaternion)),
    )


@pytest.mark.parametrize("tilt", [0.3, 0.8])
def test_exact_corners_give_the_exact_pose(tilt: float):
    marker = Marker(
        1, 0.06, "a", Pose(np.array([0.1, -0.02, 0.03]), from_rotation_vector(np.array([0.3, 0.2, 0.1])))
    )
    true = facing_pose((0.05, 0.02, 0.7), tilt, 1.1, 0.5)
    best = estimate_pose(CAMERA, [marker], {1: marker_pixels(marker, true)})[0]
    position, orientation = errors(best, true)
    assert position < 1e-5
    assert orientation < 1e-4
    assert best.error < 1e-3
    assert best.markers == (1,)


def test_board_is_solved_jointly_with_distortion(rng: np.random.Generator):
    true = facing_pose((-0.1, 0.05, 0.8), 0.5, 0.2, -0.7)
    exact = {marker.id: distorted_corners(marker, true) for marker in BOARD}
    assert errors(estimate_pose(DISTORTED, BOARD, exact)[0], true)[0] < 1e-5
    noisy = {number: corners + rng.normal(0.0, 0.3, (4, 2)) for number, corners in exact.items()}
    joint = estimate_pose(DISTORTED, BOARD, noisy)[0]
    assert joint.markers == (0, 1, 2)
    assert errors(joint, true)[0] < 0.01
    assert 0.1 < joint.error < 0.8


def test_estimate_is_a_minimum_of_the_reprojection_error(rng: np.random.Generator):
    true = facing_pose((0.0, 0.0, 0.6), 0.6, 0.9)
    pixels = {m.id: marker_pixels(m, true) + rng.normal(0.0, 0.5, (4, 2)) for m in BOARD}
    best = estimate_pose(CAMERA, BOARD, pixels)[0]

    def error(step: np.ndarray) -> float:
        moved = best.camera_from_frame @ Pose(step[:3], from_rotation_vector(step[3:]))
        all_pixels = np.concatenate([marker_pixels(m, moved) - pixels[m.id] for m in BOARD])
        return float(np.sqrt(np.mean(np.sum(all_pixels**2, axis=1))))

    assert error(np.zeros(6)) == pytest.approx(best.error, rel=1e-6)
    size = 1e-4
    slope = [(error(size * e) - error(-size * e)) / (2 * size) for e in np.eye(6)]
    curvature = [(error(size * e) + error(-size * e) - 2 * best.error) / size**2 for e in np.eye(6)]
    assert (np.array(curvature) > 0.0).all()
    assert (np.abs(slope) < 1e-3 * np.array(curvature)).all()  # less than 1 mm or 1 mrad from the minimum


def test_frontal_square_has_two_poses_that_explain_it():
    marker = Marker(0, 0.03, "a", HERE)
    true = facing_pose((0.1, 0.1, 1.0), 0.2, 0.4)
    rng = np.random.default_rng(3)
    corners = marker_pixels(marker, true) + rng.normal(0.0, 0.1, (4, 2))
    found = estimate_pose(CAMERA, [marker], {0: corners})
    assert len(found) == 2
    assert found[0].error <= found[1].error < 1.0
    assert min(errors(candidate, true)[1] for candidate in found) < 0.2


def test_contradicting_marker_is_left_out_of_three():
    true = facing_pose((0.0, 0.0, 0.7), 0.4, 0.6)
    pixels = {m.id: marker_pixels(m, true) for m in BOARD}
    pixels[1] = pixels[1] + np.array([40.0, -10.0])
    best = estimate_pose(CAMERA, BOARD, pixels, max_error=1.0)[0]
    assert best.markers == (0, 2)
    assert errors(best, true)[0] < 1e-4


def test_two_contradicting_markers_keep_a_large_error():
    true = facing_pose((0.0, 0.0, 0.7), 0.4, 0.6)
    pixels = {m.id: marker_pixels(m, true) for m in BOARD[:2]}
    pixels[1] = pixels[1] + np.array([40.0, -10.0])
    assert estimate_pose(CAMERA, BOARD[:2], pixels, max_error=1.0)[0].error > 1.0


def test_pose_from_a_warped_image_is_accurate(rng: np.random.Generator):
    marker = Marker(7, 0.1, "a", HERE)
    for _ in range(5):
        true = facing_pose((*rng.uniform(-0.08, 0.08, 2), 0.7), rng.uniform(0.3, 0.9), rng.uniform(-3, 3))
        found = detect_markers(marker_image([(marker, true)]), DICTIONARY)
        position, orientation = errors(estimate_pose(CAMERA, [marker], found.corners)[0], true)
        assert position < 0.002
        assert orientation < 0.01


@pytest.mark.parametrize(
    "corners", [np.zeros((4, 2)), np.array([[0.0, 0], [1, 1], [2, 2], [3, 3]]), np.full((4, 2), 1e5)]
)
def test_degenerate_corners_give_no_pose_or_a_large_error(corners: np.ndarray):
    found = estimate_pose(CAMERA, [Marker(0, 0.05, "a", HERE)], {0: corners})
    assert all(np.isfinite(candidate.error) for candidate in found)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_unusable_arguments_are_invalid_input():
    marker = Marker(0, 0.05, "a", HERE)
    with pytest.raises(InvalidInput, match="corners of marker 0"):
        estimate_pose(CAMERA, [marker], {0: np.full((4, 2), np.nan)})
    with pytest.raises(InvalidInput, match="shape"):
        estimate_pose(CAMERA, [marker], {0: np.zeros((3, 2))})
    with pytest.raises(InvalidInput, match="different frames"):
        estimate_pose(CAMERA, [marker, Marker(1, 0.05, "b", HERE)], {})
    assert estimate_pose(CAMERA, [marker], {}) == ()
