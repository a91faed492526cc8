"""Detection in images that are made by warping a marker's bitmap with a homography."""

import numpy as np
import pytest
from marker_images import DICTIONARY, UNIT, facing_pose, marker_image, marker_pixels

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.vision import Marker, detect_markers, marker_bitmap, refine_corners

HERE = Pose(np.zeros(3), UNIT)


@pytest.mark.parametrize("tilt", [0.0, 0.4, 0.9])
@pytest.mark.parametrize("turn", [0.0, 1.0, -2.5])
def test_corners_are_found_to_a_twentieth_of_a_pixel(tilt: float, turn: float):
    marker, pose = Marker(11, 0.08, "a", HERE), facing_pose((0.05, -0.03, 0.6), tilt, 0.7, turn)
    found = detect_markers(marker_image([(marker, pose)]), DICTIONARY)
    assert list(found.corners) == [11]
    assert found.repeated == ()
    assert np.abs(found.corners[11] - marker_pixels(marker, pose)).max() < 0.05


def test_refinement_is_better_than_its_start_and_ignores_noise(rng: np.random.Generator):
    marker, pose = Marker(2, 0.1, "a", HERE), facing_pose((0.0, 0.0, 0.7), 0.5, 0.3, 0.4)
    true = marker_pixels(marker, pose)
    image = marker_image([(marker, pose)])
    noisy = np.clip(image + rng.normal(0.0, 4.0, image.shape), 0, 255).astype(np.uint8)
    start = true + rng.uniform(-0.7, 0.7, (4, 2))
    refined = refine_corners(noisy, start)
    assert np.abs(refined - true).max() < 0.1
    assert np.abs(refined - true).max() < 0.3 * np.abs(start - true).max()


def test_refinement_keeps_corners_without_edges():
    flat, corners = (
        np.full((50, 50), 90, dtype=np.uint8),
        np.array([[10.0, 10], [40, 10], [40, 40], [10, 40]]),
    )
    np.testing.assert_array_equal(refine_corners(flat, corners), corners)
    np.testing.assert_array_equal(refine_corners(flat, np.full((4, 2), 7.0)), np.full((4, 2), 7.0))


def test_marker_found_twice_is_not_used():
    marker = Marker(5, 0.08, "a", HERE)
    image = marker_image([(marker, facing_pose((x, 0.0, 0.6), 0.1)) for x in (-0.12, 0.12)])
    found = detect_markers(image, DICTIONARY)
    assert found.repeated == (5,)
    assert not found.corners


def test_image_without_markers_and_another_dictionary_give_nothing():
    marker = Marker(5, 0.1, "a", HERE)
    image = marker_image([(marker, facing_pose((0.0, 0.0, 0.5), 0.0))])
    assert not detect_markers(np.zeros((480, 640), dtype=np.uint8), DICTIONARY).corners
    assert not detect_markers(image, "aruco_4x4_50").corners
    colour = np.repeat(image[:, :, None], 3, axis=2)
    assert list(detect_markers(colour, DICTIONARY).corners) == [5]


def test_bitmap_has_a_black_border():
    bitmap = marker_bitmap(DICTIONARY, 0, 3)
    assert bitmap.shape == (30, 30) or bitmap.shape == (24, 24)
    edge = np.concatenate(
        [bitmap[:3].ravel(), bitmap[-3:].ravel(), bitmap[:, :3].ravel(), bitmap[:, -3:].ravel()]
    )
    assert edge.max() == 0
    assert bitmap.max() == 255


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    "image",
    [None, "image", np.zeros((480, 640)), np.zeros((4, 4), np.uint8), np.zeros((64, 64, 4), np.uint8),
     np.zeros(9, np.uint8), np.zeros((0, 0), np.uint8), np.zeros((8, 40000), np.uint8)],
)  # fmt: skip
def test_unusable_image_is_invalid_input(image):
    with pytest.raises(InvalidInput, match="image"):
        detect_markers(image, DICTIONARY)


def test_unknown_dictionary_names_the_nearest():
    with pytest.raises(InvalidInput, match="did you mean 'apriltag_36h11'"):
        detect_markers(np.zeros((64, 64), np.uint8), "apriltag_36h1")
    with pytest.raises(InvalidInput, match="586"):
        marker_bitmap(DICTIONARY, 587)
