"""Poses in one reference frame: compared with products of 4x4 matrices along the tree of transforms."""

import numpy as np
import pytest

from pilotfish.demonstrations import Recording, Signal, suggest_settings, to_common_reference_frames
from pilotfish.geometry import normalise, rotation_matrix

POSE = tuple(f"position.{axis}" for axis in "xyz") + tuple(f"orientation.{axis}" for axis in "xyzw")
TRANSFORM = tuple(f"translation.{axis}" for axis in "xyz") + tuple(f"rotation.{axis}" for axis in "xyzw")
UNITS = ("m",) * 3 + ("1",) * 4


def random_rows(rng: np.random.Generator, steps: int) -> np.ndarray:
    """Return positions and quaternions x y z w that turn slowly."""
    start, change = rng.normal(size=4), 0.02 * rng.normal(size=4)
    quaternions = normalise(start + np.arange(steps)[:, None] * change)
    return np.hstack([rng.normal(size=(steps, 3)), quaternions])


def matrices(rows: np.ndarray) -> np.ndarray:
    """Return a 4x4 matrix for each row of position and quaternion x y z w."""
    result = np.tile(np.eye(4), (len(rows), 1, 1))
    result[:, :3, :3] = rotation_matrix(np.roll(rows[:, 3:], 1, axis=1))
    result[:, :3, 3] = rows[:, :3]
    return result


def pose_signal(name: str, rows: np.ndarray, frame: str, times: np.ndarray | None = None) -> Signal:
    times = 0.1 * np.arange(len(rows)) if times is None else times
    return Signal(name, rows, POSE, UNITS, times, frame)


def transform_signal(child: str, rows: np.ndarray, parent: str, times: np.ndarray | None = None) -> Signal:
    times = 0.1 * np.arange(len(rows)) if times is None else times
    return Signal(f"/tf/{child}", rows, TRANSFORM, UNITS, times, parent)


CHILDREN = {f"/tf/{child}": child for child in ("camera", "optical", "link", "tool", "marker", "cube")}


def test_object_of_camera_is_expressed_in_base_of_tool(rng):
    """The tool is in the base; the camera moves in the world, in which the base stands."""
    steps = 20
    base, camera, optical = (random_rows(rng, n) for n in (1, steps, 1))
    tool, cube = random_rows(rng, steps), random_rows(rng, steps)
    signals = (
        pose_signal("/tool", tool, "base"),
        pose_signal("/cube", cube, "optical"),
        transform_signal("camera", camera, "base"),
        transform_signal("optical", optical, "camera"),
        Signal("/tf/base", base, TRANSFORM, UNITS, np.zeros(1), "world"),
    )
    found, notes = to_common_reference_frames(signals, CHILDREN | {"/tf/base": "base"})
    by_name = {signal.name: signal for signal in found}
    assert {name: s.reference_frame for name, s in by_name.items()} == {"/tool": "base", "/cube": "base"}
    np.testing.assert_array_equal(by_name["/tool"].values, tool)
    expected = matrices(camera) @ matrices(optical) @ matrices(cube)
    np.testing.assert_allclose(matrices(by_name["/cube"].values), expected, atol=1e-12)
    assert notes[0] == "/cube: poses in frame 'optical' converted to frame 'base'"
    assert "/tf/camera, /tf/optical" in notes[1]


def test_transforms_alone_are_expressed_in_the_root(rng):
    """An arm publishes its links; the tool is the product of all of them."""
    link, tool, marker = random_rows(rng, 5), random_rows(rng, 1), random_rows(rng, 5)
    signals = (
        transform_signal("link", link, "base"),
        transform_signal("tool", tool, "link", np.zeros(1)),
        transform_signal("marker", marker, "base"),
    )
    found, _ = to_common_reference_frames(signals, CHILDREN)
    assert [(signal.name, signal.reference_frame) for signal in found] == [
        ("/tf/tool", "base"),
        ("/tf/marker", "base"),
    ]
    np.testing.assert_allclose(matrices(found[0].values), matrices(link)[:1] @ matrices(tool), atol=1e-12)


def test_rows_between_those_of_a_transform_are_interpolated_and_far_ones_left_out(rng):
    """The transform moves at constant speed, so that the middle is exact; it ends at 1 s."""
    turn = np.array([0.0, 0.0, 0.0, 1.0])
    camera = np.array([[0.0, 0.0, 0.0, *turn], [1.0, 0.0, 0.0, *turn]])
    times = np.array([0.0, 0.25, 0.5, 0.9, 1.2])
    cube = np.tile([0.0, 2.0, 0.0, *turn], (5, 1))
    signals = (
        pose_signal("/tool", cube, "base", times),
        pose_signal("/cube", cube, "camera", times),
        transform_signal("camera", camera, "base", np.array([0.0, 0.5])),
    )
    found, notes = to_common_reference_frames(signals, CHILDREN)
    np.testing.assert_allclose(found[1].values[:, 0], [0.0, 0.5, 1.0], atol=1e-12)
    np.testing.assert_array_equal(found[1].times, times[:3])
    assert "2 of 5 rows at times without a transform are left out" in notes[0]


@pytest.mark.parametrize("start", [1.5, 4.0])
def test_late_transform_moves_no_pose(start, rng):
    """The cube stands still, and the camera moves from the start; poses before its transform are left out."""
    times = 0.1 * np.arange(60)
    camera = np.stack([0.05 * times, *np.zeros((5, 60)), np.ones(60)], axis=1)
    cube = np.array([0.5, 0.2, 0.05, 0.0, 0.0, 0.0, 1.0])
    seen = cube - np.hstack([camera[:, :3], np.zeros((60, 4))])
    late = times >= start
    signals = (
        pose_signal("/tool", random_rows(rng, 60), "base", times),
        pose_signal("/cube", seen, "camera", times),
        transform_signal("camera", camera[late], "base", times[late]),
    )
    found, _ = to_common_reference_frames(signals, CHILDREN)
    assert found[1].times is not None
    assert found[1].times[0] >= start - 1e-6
    np.testing.assert_allclose(found[1].values, np.tile(cube, (len(found[1].values), 1)), atol=1e-12)


def test_gap_of_a_transform_is_not_interpolated(rng):
    times = 0.1 * np.arange(40)
    camera = np.stack([times, *np.zeros((5, 40)), np.ones(40)], axis=1)
    known = (times < 1.0) | (times > 2.0)
    cube = np.tile([0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0], (40, 1))
    signals = (
        pose_signal("/tool", cube, "base", times),
        pose_signal("/cube", cube, "camera", times),
        transform_signal("camera", camera[known], "base", times[known]),
    )
    found, _ = to_common_reference_frames(signals, CHILDREN)
    np.testing.assert_allclose(found[1].values[:, 0], found[1].times, atol=1e-12)
    assert len(found[1].values) == pytest.approx(known.sum(), abs=1)


def test_cycle_is_named(rng):
    signals = (
        pose_signal("/tool", random_rows(rng, 3), "base"),
        transform_signal("camera", random_rows(rng, 3), "optical"),
        transform_signal("optical", random_rows(rng, 3), "camera"),
    )
    _, notes = to_common_reference_frames(signals, CHILDREN)
    assert "the transforms of camera, optical form a cycle" in notes[0]


def test_points_without_orientation_are_converted(rng):
    camera, points = random_rows(rng, 1), rng.normal(size=(3, 3))
    signals = (
        pose_signal("/tool", random_rows(rng, 3), "base"),
        Signal("/point", points, ("x", "y", "z"), ("m",) * 3, 0.1 * np.arange(3), "camera"),
        transform_signal("camera", camera, "base", np.zeros(1)),
    )
    found, _ = to_common_reference_frames(signals, CHILDREN)
    ones = np.hstack([points, np.ones((3, 1))])
    np.testing.assert_allclose(found[1].values, (ones @ matrices(camera)[0].T)[:, :3], atol=1e-12)


@pytest.mark.parametrize(
    "broken", [np.full(7, np.nan), np.zeros(7), np.array([np.inf, 0, 0, 0, 0, 0, 1.0])], ids=str
)
def test_unusable_transforms_and_cycles_leave_poses_as_they_are(broken, rng):
    tool, cube = random_rows(rng, 3), random_rows(rng, 3)
    poses = (pose_signal("/tool", tool, "base"), pose_signal("/cube", cube, "camera"))
    lost = transform_signal("camera", np.tile(broken, (3, 1)), "base")
    cycle = (
        transform_signal("camera", random_rows(rng, 3), "optical"),
        transform_signal("optical", random_rows(rng, 3), "camera"),
    )
    for transforms in ((lost,), cycle):
        found, _ = to_common_reference_frames((*poses, *transforms), CHILDREN)
        for signal, rows in zip(found[:2], (tool, cube), strict=True):
            np.testing.assert_array_equal(signal.values, rows)


@pytest.mark.parametrize(
    ("tool", "cube", "asked"),
    [
        ("base", "base", False),
        ("base", "camera", True),
        ("", "base", False),
        ("", "camera_optical_frame", True),
        ("base", "", False),
        ("", "", False),
    ],
)
def test_poses_in_unrelated_frames_are_asked_about(tool, cube, asked, rng):
    signals = (
        pose_signal("/tool", random_rows(rng, 9), tool),
        pose_signal("/cube", random_rows(rng, 9), cube),
    )
    _, questions = suggest_settings([Recording("a", signals)])
    texts = [question.text for question in questions if "relative to" in question.text]
    assert bool(texts) == asked
    assert all("/cube is relative to" in text for text in texts)
