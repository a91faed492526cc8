"""File of markers: what it means, and a message for every mistake."""

from pathlib import Path

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector
from pilotfish.vision import Camera, Marker, MarkerSetup, parse_markers, read_markers, write_camera

TEXT = """
format = "pilotfish markers"
version = 1
dictionary = "apriltag_36h11"

[camera]
width = 640
height = 480
fx = 600.0
fy = 610.0
cx = 320.0
cy = 240.0
position = [0.5, 0.0, 1.0]
quaternion = [0.0, 1.0, 0.0, 0.0]

[[marker]]
id = 3
side = 0.05
frame = "valve"

[[marker]]
id = 4
side = 0.04
frame = "valve"
position = [0.1, 0.0, 0.0]

[[marker]]
id = 5
side = 0.05
frame = "tray"
"""
REFERENCE = """
[reference]
id = 9
side = 0.1
position = [1.0, 2.0, 0.0]
quaternion = [1.0, 0.0, 0.0, 0.0]
"""
POSE = "position = [0.5, 0.0, 1.0]\nquaternion = [0.0, 1.0, 0.0, 0.0]\n"


def parse(text: str) -> MarkerSetup:
    return parse_markers(text.encode(), "markers.toml", Path())


def test_file_gives_frames_markers_and_camera():
    setup = parse(TEXT)
    assert setup.frames == ("valve", "tray")
    assert [marker.id for marker in setup.markers] == [3, 4, 5]
    assert setup.camera == Camera(640, 480, 600.0, 610.0, 320.0, 240.0)
    assert setup.base_from_camera is not None
    assert setup.reference is None
    np.testing.assert_allclose(setup.base_from_camera.position, [0.5, 0.0, 1.0])


def test_corners_move_against_the_pose_of_the_frame():
    setup = parse(TEXT)
    centre = setup.markers[1].corners_in_frame.mean(axis=0)  # the frame is at x = 0.1 in the marker
    np.testing.assert_allclose(centre, [-0.1, 0.0, 0.0], atol=1e-15)
    turned = Marker(0, 0.2, "a", Pose(np.zeros(3), from_rotation_vector(np.array([0.0, 0.0, np.pi / 2]))))
    np.testing.assert_allclose(turned.corners_in_frame[0], [0.1, 0.1, 0.0], atol=1e-15)


def test_reference_gives_the_pose_of_the_marker_in_the_base():
    setup = parse(TEXT.replace(POSE, "") + REFERENCE)
    assert setup.base_from_camera is None
    assert setup.reference is not None
    np.testing.assert_allclose(setup.reference.corners_in_frame.mean(axis=0), [1.0, 2.0, 0.0], atol=1e-15)


def test_camera_may_be_another_file(tmp_path):
    camera = Camera(320, 240, 300.0, 300.0, 160.0, 120.0, (0.1, 0.0, 0.0, 0.0))
    write_camera(tmp_path / "lab.toml", camera, rms_error=0.2, views=8)
    values = TEXT[TEXT.index("width") : TEXT.index("position")]
    (tmp_path / "markers.toml").write_text(TEXT.replace(values, 'file = "lab.toml"\n'))
    assert read_markers(tmp_path / "markers.toml").camera == camera


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("side = 0.05", "side = -0.05", "marker 0: side"),
        ("side = 0.05", "side = nan", "marker 0: side"),
        ("side = 0.05", "sides = 0.05", "unknown key 'sides'; did you mean 'side'"),
        ("side = 0.04", 'side = "0.04"', "marker 1: side"),
        ("id = 4", "id = 3", "id 3 is given to two markers"),
        ("id = 4", "id = 587", "expected a whole number from 0 to 586"),
        ("id = 4", "id = 1.5", "marker 1: id"),
        ("apriltag_36h11", "apriltag_36h12", "did you mean 'apriltag_36h1"),
        ('frame = "tray"', 'frame = ""', "marker 2: frame"),
        ('frame = "tray"', "", "marker 2: key 'frame' is missing"),
        ("position = [0.1, 0.0, 0.0]", "position = [0.1, 0.0]", "marker 1: position"),
        ("position = [0.1, 0.0, 0.0]", "quaternion = [1, 1, 0, 0]", "norm"),
        ("position = [0.5, 0.0, 1.0]\n", "", "camera: key 'position' is missing"),
        ("fx = 600.0\n", "", "camera: key 'fx' is missing"),
        ("cx = 320.0", "cx = inf", "camera: cx"),
        ("width = 640\n", 'file = "missing.toml"\n', "camera: unknown key 'height'"),
        ("version = 1", "version = 2", "newer version"),
        ("version = 1", "", "version"),
        ("[camera]", "[camra]", "did you mean 'camera'"),
        ('format = "pilotfish markers"', "", "format is None"),
        ("[[marker]]", "[[marker]", "not TOML"),
    ],
)  # fmt: skip
def test_mistake_is_explained(old: str, new: str, message: str):
    assert old in TEXT
    with pytest.raises(InvalidInput, match=r"markers\.toml") as error:
        parse(TEXT.replace(old, new, 1))
    assert message in str(error.value)


def test_pose_of_the_camera_and_reference_exclude_each_other():
    with pytest.raises(InvalidInput, match="both the pose of the camera and a reference"):
        parse(TEXT + REFERENCE)


def test_id_of_reference_must_differ_from_the_others():
    with pytest.raises(InvalidInput, match="id 3 is given to two markers"):
        parse(TEXT.replace(POSE, "") + REFERENCE.replace("id = 9", "id = 3"))


def test_empty_and_missing_lists_of_markers_are_refused():
    head = TEXT[: TEXT.index("[[marker]]")]
    for text in (
        head,
        head.replace("[camera]", "marker = []\n[camera]"),
        head.replace("[camera]", "marker = 3\n[camera]"),
    ):
        with pytest.raises(InvalidInput, match="marker"):
            parse(text)
    with pytest.raises(InvalidInput, match="UTF-8"):
        parse_markers(b"\xff\xfe\x00", "markers.toml", Path())
