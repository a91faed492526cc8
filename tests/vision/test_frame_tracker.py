"""Tracking over images: rejection, loss, reference marker, continuity."""

from dataclasses import replace

import numpy as np
import pytest
from marker_images import CAMERA, DICTIONARY, UNIT, facing_pose, marker_image

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, from_rotation_vector, pose
from pilotfish.vision import FrameTracker, Marker, MarkerSetup, Rejection, TrackerSettings

HERE = Pose(np.zeros(3), UNIT)
MARKER = Marker(
    4, 0.1, "tray", Pose(np.array([0.02, 0.0, 0.0]), from_rotation_vector(np.array([0.0, 0.0, 0.5])))
)
SETUP = MarkerSetup(DICTIONARY, (MARKER,), CAMERA)
EMPTY = np.full((480, 640), 128, dtype=np.uint8)


def near(a: Pose, b: Pose) -> bool:
    return (
        float(np.linalg.norm(a.position - b.position)) < 0.003
        and float(angle(a.quaternion, b.quaternion)) < 0.02
    )


def test_pose_is_given_in_camera_axes_without_a_base():
    true = facing_pose((0.02, 0.01, 0.6), 0.5, 0.3)
    observed = FrameTracker(SETUP).observe(marker_image([(MARKER, true)]), 0.0)["tray"]
    assert observed.pose is not None
    assert near(observed.pose, true)
    assert observed.rejection is None
    assert observed.error < 0.2


def test_pose_of_the_camera_leads_to_the_base():
    base_from_camera = pose([1.0, 2.0, 3.0], [0.5, 0.5, -0.5, 0.5])
    true = facing_pose((0.02, 0.01, 0.6), 0.5, 0.3)
    tracker = FrameTracker(replace(SETUP, base_from_camera=base_from_camera))
    observed = tracker.observe(marker_image([(MARKER, true)]), 0.0)["tray"]
    assert observed.pose is not None
    assert near(observed.pose, base_from_camera @ true)


def test_reference_marker_leads_to_the_base_wherever_the_camera_is():
    reference = Marker(9, 0.1, "base", pose([0.3, -0.1, 0.0], [1.0, 0.0, 0.0, 0.0]))
    tracker = FrameTracker(replace(SETUP, reference=reference))
    base_from_tray = pose([-0.1, 0.1, 0.02], from_rotation_vector(np.array([0.1, 0.2, 0.4])))
    for time, position in enumerate([(-0.15, -0.1, 0.8), (-0.2, -0.1, 0.75)]):
        camera_from_base = facing_pose(position, 0.5, 0.2 + time) @ reference.marker_from_frame
        image = marker_image([(MARKER, camera_from_base @ base_from_tray), (reference, camera_from_base)])
        observed = tracker.observe(image, float(time))["tray"]
        assert observed.pose is not None
        assert near(observed.pose, base_from_tray)
    image = marker_image([(MARKER, facing_pose((0.0, 0.0, 0.6), 0.3))])
    assert tracker.observe(image, 3.0)["tray"].rejection is Rejection.REFERENCE


def test_lost_marker_repeats_nothing_and_returns():
    tracker, true = FrameTracker(SETUP), facing_pose((0.0, 0.0, 0.6), 0.4)
    image = marker_image([(MARKER, true)])
    assert tracker.observe(image, 0.0)["tray"].pose is not None
    lost = tracker.observe(EMPTY, 0.1)["tray"]
    assert lost.pose is None
    assert lost.rejection is Rejection.NOT_FOUND
    assert np.isnan(lost.error)
    assert tracker.observe(image, 0.2)["tray"].pose is not None


def test_jump_is_rejected_until_the_speed_is_plausible():
    tracker = FrameTracker(SETUP, TrackerSettings(max_speed=1.0))
    here, there = (marker_image([(MARKER, facing_pose((x, 0.0, 0.6), 0.4))]) for x in (-0.1, 0.1))
    assert tracker.observe(here, 0.0)["tray"].pose is not None
    assert tracker.observe(there, 0.1)["tray"].rejection is Rejection.JUMP  # 2 m/s
    assert tracker.observe(there, 0.19)["tray"].rejection is Rejection.JUMP
    assert tracker.observe(there, 0.3)["tray"].pose is not None  # 0.67 m/s since the last accepted pose


def test_turn_that_is_too_fast_is_a_jump():
    tracker = FrameTracker(SETUP, TrackerSettings(max_angular_speed=2.0))
    images = [marker_image([(MARKER, facing_pose((0.0, 0.0, 0.6), 0.4, 0.0, turn))]) for turn in (0.0, 1.0)]
    assert tracker.observe(images[0], 0.0)["tray"].pose is not None
    assert tracker.observe(images[1], 0.1)["tray"].rejection is Rejection.JUMP


def test_large_reprojection_error_is_rejected():
    bent = Marker(5, 0.1, "tray", pose([0.25, 0.0, 0.0], UNIT))  # said to be elsewhere than it is
    setup = replace(SETUP, markers=(Marker(4, 0.1, "tray", HERE), bent))
    true = facing_pose((-0.1, 0.0, 0.7), 0.4)
    moved = Marker(5, 0.1, "tray", pose([-0.2, 0.0, 0.0], UNIT))
    observed = FrameTracker(setup).observe(marker_image([(setup.markers[0], true), (moved, true)]), 0.0)[
        "tray"
    ]
    assert observed.pose is None
    assert observed.rejection is Rejection.ERROR
    assert observed.error > 2.0


def test_marker_found_twice_is_named():
    image = marker_image([(MARKER, facing_pose((x, 0.0, 0.6), 0.2)) for x in (-0.15, 0.15)])
    assert FrameTracker(SETUP).observe(image, 0.0)["tray"].rejection is Rejection.REPEATED


def test_continuity_decides_between_two_plausible_orientations():
    tracker = FrameTracker(SETUP)
    a, b = facing_pose((0.0, 0.0, 0.6), 0.5), facing_pose((0.0, 0.0, 0.6), -0.5)
    assert tracker._nearest("tray", [a, b]) == 0
    tracker._accepted["tray"], tracker._time = (0.0, b), 0.1
    assert tracker._nearest("tray", [a, b]) == 1
    tracker._time = 10.0  # too long ago
    assert tracker._nearest("tray", [a, b]) == 0


def test_other_size_and_unordered_times_are_invalid_input():
    tracker = FrameTracker(SETUP)
    with pytest.raises(InvalidInput, match="320 x 240 pixels, but the camera was calibrated with 640 x 480"):
        tracker.observe(np.zeros((240, 320), np.uint8), 0.0)
    tracker.observe(EMPTY, 1.0)
    with pytest.raises(InvalidInput, match="increasing"):
        tracker.observe(EMPTY, 1.0)
    with pytest.raises(InvalidInput, match="time"):
        tracker.observe(EMPTY, np.nan)


def test_picture_has_axes_at_the_frame():
    tracker, true = FrameTracker(SETUP), facing_pose((0.0, 0.0, 0.6), 0.3)
    image = marker_image([(MARKER, true)])
    picture = tracker.draw(image, tracker.observe(image, 0.0))
    assert picture.shape == (480, 640, 3)
    changed = np.argwhere((picture != image[:, :, None]).any(axis=2))
    centre = np.array([CAMERA.cy, CAMERA.cx])
    assert np.abs(changed - centre).max() < 110
    assert len(changed) > 100
    np.testing.assert_array_equal(image, marker_image([(MARKER, true)]))
