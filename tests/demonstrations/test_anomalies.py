"""Anomalies of real recordings: each is found with its numbers, and the same recording without it has none.

The numbers come from recordings as laboratories have them: logs faster than their source, other units,
trackers that lose an object.
"""

from collections.abc import Callable

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    demonstration,
    diagnose,
    frame,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    position_layout,
)
from pilotfish.geometry import Pose, multiply

POSE, STEPS = pose_layout(), 60


def yaw(angle: float) -> np.ndarray:
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def object_pose(m: int) -> Pose:
    """Return the pose of the object in demonstration m, which turns from one to the next."""
    return Pose(np.array([0.6, -0.2 + 0.1 * m, 0.1]), yaw(0.5 * m - 0.7))


def rows(m: int, rng: np.random.Generator) -> np.ndarray:
    """Return a pouring motion that is the same relative to the object, with 0.5 mm of noise."""
    t, given = np.linspace(0, 1, STEPS), object_pose(m)
    local = np.stack([-0.2 * (1 - t), 0.05 * np.sin(3 * t), 0.2 * (1 - t)], axis=1)
    local += rng.normal(size=local.shape) * 5e-4
    poses = [
        given @ Pose(p, np.array([np.cos(0.5 + 0.4 * s), np.sin(0.5 + 0.4 * s), 0.0, 0.0]))
        for p, s in zip(local, t, strict=True)
    ]
    return np.array([[*pose.position, *pose.quaternion] for pose in poses])


def to_xyzw(q: np.ndarray) -> np.ndarray:
    return np.roll(q, -1, axis=-1)


Change = Callable[[int, np.ndarray, Pose], tuple[np.ndarray, list]]


def unchanged(m: int, x: np.ndarray, given: Pose) -> tuple[np.ndarray, list]:
    return x, [frame_from_pose("cup", POSE, given)]


def demonstrations(rng: np.random.Generator, change: Change = unchanged) -> list[Demonstration]:
    result = []
    for m in range(4):
        x, frames = change(m, rows(m, rng), object_pose(m))
        result.append(demonstration(x, 0.1, POSE, frames, f"d{m}"))
    return result


def positions(rng: np.random.Generator, scale: float = 1.0, unit: str = "m") -> list[Demonstration]:
    layout = Layout((Part("position", Quantity.POSITION, 3, unit),))
    cups = [object_pose(m).position for m in range(4)]
    frames = [frame("cup", np.eye(3), cup * scale) for cup in cups]
    return [demonstration(rows(m, rng)[:, :3] * scale, 0.1, layout, [frames[m]], f"d{m}") for m in range(4)]


def kinds(found: tuple) -> list[str]:
    return [diagnostic.kind for diagnostic in found]


def test_set_without_anomalies_has_no_diagnostics(rng):
    assert diagnose(demonstrations(rng)) == ()
    assert diagnose(positions(rng)) == ()


@pytest.mark.parametrize(
    ("scale", "unit", "expected"),
    [
        (1.0, "mm", ["units", "size"]),  # metres declared as mm
        (1000.0, "mm", ["units"]),
        (1000.0, "m", ["size"]),  # mm declared as metres
        (100.0, "m", ["size"]),  # a workspace of 28 m
    ],
)
def test_implausible_units_are_found(scale, unit, expected, rng):
    assert kinds(diagnose(positions(rng, scale, unit))) == expected


@pytest.mark.parametrize("held", [2, 5, 10, 20, 50])
def test_held_rows_are_found_with_the_true_period(held, rng):
    slow = positions(rng)
    fast = [demonstration(np.repeat(d.x, held, axis=0), 0.1 / held, d.layout, d.frames, d.name) for d in slow]
    (found,) = diagnose(fast)
    assert found.location == "all demonstrations:"
    assert f"for {held} rows: its true period is 0.1 s" in found.message
    assert "x[::n]" in found.fix


@pytest.mark.parametrize(
    ("times", "text"),
    [
        (np.arange(STEPS) / 30, "ascends by 0.03333 to 0.03333 s per row"),
        (np.arange(STEPS)[::-1] * 0.1, "does not ascend at row 1"),
        (np.arange(STEPS) * 0.1, "is learned as a coordinate"),
        (0.1 * np.arange(STEPS) + 0.03 * (np.arange(STEPS) % 2), "median"),
    ],
    ids=["30 fps", "backwards", "as the period", "jitter"],
)
def test_times_are_compared_with_the_period(times, text, rng):
    layout = Layout((Part("time", Quantity.SCALAR, 1, "s"), Part("position", Quantity.POSITION, 3, "m")))
    given = [demonstration(np.c_[times, rows(m, rng)[:, :3]], 0.1, layout) for m in range(2)]
    found = diagnose(given)
    assert [d for d in found if text in d.message]
    assert all(d.kind in ("times", "time column") for d in found)


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2 * np.pi), ("deg", 360.0)])
def test_angle_that_wraps_around_is_named(unit, turn, rng):
    layout = Layout((Part("joint", Quantity.SCALAR, 1, unit),))
    smooth = np.linspace(0.3, 0.7, STEPS)[:, None] * turn + rng.normal(size=(STEPS, 1)) * 1e-4 * turn
    wrapped = (smooth + turn / 2) % turn - turn / 2
    found = diagnose([demonstration(wrapped, 0.1, layout), demonstration(smooth, 0.1, layout)])
    (wrap,) = [d for d in found if d.kind == "wrap-around"]
    row = int(np.argmax(np.abs(np.diff(wrapped[:, 0])))) + 1
    assert f"joint jumps by a whole turn at row {row}" in wrap.message
    assert wrap.location == "demonstration 0"
    assert not [d for d in found if d.kind == "jumps"]


def test_gripper_has_no_jumps(rng):
    layout = Layout((Part("position", Quantity.POSITION, 3, "m"), Part("gripper", Quantity.SCALAR, 1, "1")))
    grip = 100.0 * (np.arange(STEPS) > 30)
    given = [demonstration(np.c_[rows(m, rng)[:, :3], grip], 0.1, layout) for m in range(2)]
    assert diagnose(given) == ()


def test_opposite_signs_are_a_note(rng):
    given = demonstrations(rng, lambda m, x, o: unchanged(m, x * ([1] * 3 + [(-1) ** m] * 4), o))
    (found,) = diagnose(given)
    assert (found.severity, found.kind, found.location) == ("note", "opposite signs", "demonstrations 1, 3:")


@pytest.mark.parametrize("subject", ["the tool", "frame 'cup'"])
def test_quaternions_in_order_x_y_z_w_are_found(subject, rng):
    def change(m: int, x: np.ndarray, given: Pose) -> tuple[np.ndarray, list]:
        if subject == "the tool":
            return np.c_[x[:, :3], to_xyzw(x[:, 3:])], [frame_from_pose("cup", POSE, given)]
        wrong = Pose(given.position, to_xyzw(given.quaternion))
        return x, [frame_from_pose("cup", POSE, wrong)]

    found = [d for d in diagnose(demonstrations(rng, change)) if d.kind == "quaternion order"]
    assert len(found) == 1
    assert f"quaternions of {subject} seem to be x y z w" in found[0].message


@pytest.mark.parametrize(
    ("kind", "matrix", "offset"),
    [
        ("mirrored frame", np.diag([-1.0, 1.0, 1.0]), 1.0),
        ("scaled frame", 2.0 * np.eye(3), 1.0),
        ("contradictory frame", None, 1.0),
        ("far frame", np.eye(3), 1000.0),
    ],
)
def test_frames_of_no_object_are_found(kind, matrix, offset, rng):
    def change(m: int, x: np.ndarray, given: Pose) -> tuple[np.ndarray, list]:
        right = frame_from_pose("cup", POSE, given)
        A, b = right.A.copy(), right.b.copy()
        A[:3, :3] = np.eye(3) if matrix is None else A[:3, :3] @ matrix
        b[:3] *= offset
        return x, [frame("cup", A, b)]

    found = diagnose(demonstrations(rng, change))
    assert [d.kind for d in found if "frame" in d.kind] == [kind]
    assert all("frame 'cup'" in d.message for d in found if d.kind == kind)


def tracked(m: int, given: Pose, fault: str, rng: np.random.Generator) -> MovingFrame:
    """Return a moving object whose tracker holds or loses it from row 20 on."""
    place = given.position + np.linspace(0, 0.6, STEPS)[:, None] * [1.0, 0.0, 0.0]
    place += rng.normal(size=place.shape) * 2e-4
    turn = np.tile(given.quaternion, (STEPS, 1))
    if fault == "held frame":
        place[20:25] = place[20]
    if fault == "lost frame":
        place[20:24], turn[20:24] = 0.0, [1.0, 0.0, 0.0, 0.0]
    return moving_frame_from_poses("cup", POSE, [Pose(p, q) for p, q in zip(place, turn, strict=True)])


@pytest.mark.parametrize("fault", ["", "held frame", "lost frame"])
def test_trackers_that_lose_an_object_are_found(fault, rng):
    found = diagnose(demonstrations(rng, lambda m, x, o: (x, [tracked(m, o, fault, rng)])))
    assert kinds(found) == ([fault] if fault else [])
    assert all("from row 20" in d.message for d in found)


def test_missing_frame_is_found_and_unneeded_one_is_not(rng):
    missing = diagnose(demonstrations(rng, lambda m, x, o: (x, [])))
    assert kinds(missing) == ["missing frame"]
    assert "after each is moved and turned" in missing[0].message
    same = [demonstration(rows(1, rng), 0.1, POSE, (), f"d{m}") for m in range(4)]
    assert diagnose(same) == ()
    unrelated = [
        demonstration(np.cumsum(rng.normal(size=(STEPS, 3)), axis=0) * 0.01, 0.1, position_layout())
        for _ in range(4)
    ]
    assert diagnose(unrelated) == ()


def test_numbers_agree_with_quaternions_of_the_object(rng):
    """The pouring motion is the same relative to the object: what the checks above rely on."""
    relative = [multiply(object_pose(m).inverse().quaternion, rows(m, rng)[-1, 3:]) for m in range(4)]
    np.testing.assert_allclose(relative, relative[:1] * 4, atol=1e-12)
