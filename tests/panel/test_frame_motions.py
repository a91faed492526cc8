"""Poses of frames, and frames after a motion: compared with frames built from poses."""

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    frame,
    frame_from_pose,
    pose_layout,
    position_layout,
    to_sphere,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, normalise, quaternion_exp
from pilotfish.models import Skill
from pilotfish.panel import frame_pose, move_frame

FORCE = Part("force", Quantity.VECTOR, 3, "N")
GRIP = Part("grip", Quantity.SCALAR, 1, "1")


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), normalise(rng.normal(size=4)))


def test_frame_pose_returns_pose_of_frame(rng: np.random.Generator):
    expected = random_pose(rng)
    actual = frame_pose(frame_from_pose("cup", pose_layout(), expected), pose_layout())
    np.testing.assert_allclose(actual.position, expected.position)
    assert angle(actual.quaternion, expected.quaternion) < 1e-7


@pytest.mark.parametrize("has_rates", [False, True])
@pytest.mark.parametrize("is_sphere", [False, True])
def test_move_frame_equals_frame_of_target(rng: np.random.Generator, has_rates: bool, is_sphere: bool):
    """A frame from a pose, moved to another pose, is the frame from that pose, up to signs."""
    parts = (*pose_layout().parts, FORCE, GRIP)
    layout = Layout(parts)
    if is_sphere:
        layout = Layout((parts[0], Part("orientation", Quantity.ORIENTATION, 4, "1"), *parts[2:]))
    layout = layout.differentiate() if has_rates else layout
    before, target = random_pose(rng), random_pose(rng)
    moved = move_frame(frame_from_pose("cup", layout, before), layout, target)
    expected = frame_from_pose("cup", layout, target)
    np.testing.assert_allclose(moved.b, expected.b, atol=1e-12)
    signs = np.ones(layout.width)
    for columns in layout.unit_quaternions:
        signs[columns] = np.sign(
            moved.A[columns.start, columns.start] * expected.A[columns.start, columns.start]
        )
    if has_rates and not is_sphere:
        rates = layout.columns("orientation", 1)
        signs[rates] = signs[layout.columns("orientation")]
    np.testing.assert_allclose(moved.A, signs[:, None] * expected.A, atol=1e-12)


def test_move_frame_keeps_scale_of_local_coordinates(rng: np.random.Generator):
    """A point fixed in the object keeps its distance to the origin, whatever the unit inside the frame."""
    layout = position_layout(3)
    before = frame("cup", 1e-3 * np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3))
    target, local = random_pose(rng), rng.normal(size=3)
    moved = move_frame(before, layout, target)
    np.testing.assert_allclose(moved.b, target.position)
    np.testing.assert_allclose(np.linalg.norm(moved.A @ local), np.linalg.norm(before.A @ local))
    assert angle(frame_pose(moved, layout).quaternion, target.quaternion) < 1e-6


def test_move_frame_in_plane_turns_about_normal(rng: np.random.Generator):
    layout, turn = position_layout(2), float(rng.uniform(-3.0, 3.0))
    target = Pose(np.array([1.0, 2.0, 0.0]), quaternion_exp(np.array([0.0, 0.0, 0.5 * turn])))
    moved = move_frame(frame("object", np.eye(2), np.zeros(2)), layout, target)
    np.testing.assert_allclose(moved.A @ [1.0, 0.0], [np.cos(turn), np.sin(turn)], atol=1e-12)
    np.testing.assert_allclose(moved.b, [1.0, 2.0])


def test_move_frame_on_line_translates_only(rng: np.random.Generator):
    moved = move_frame(frame("object", [[2.0]], [1.0]), position_layout(1), random_pose(rng))
    assert moved.A == [[2.0]]


def test_move_frame_of_mirror_reaches_target(rng: np.random.Generator):
    """A frame that mirrors has a pose with one axis reversed, and can be moved by it."""
    layout, target = position_layout(3), random_pose(rng)
    moved = move_frame(frame("left", np.diag([1.0, 1.0, -1.0]), np.zeros(3)), layout, target)
    assert np.linalg.det(moved.A) == pytest.approx(-1.0)
    assert angle(frame_pose(moved, layout).quaternion, target.quaternion) < 1e-6


def test_moved_frame_moves_the_reproduction_with_all_objects(
    rng: np.random.Generator, reach_skill: Skill, reaches: tuple[Demonstration, ...]
):
    """If all objects move alike, the motion moves with them."""
    from pilotfish.panel import compute_reproduction

    layout, shift = reach_skill.layout, rng.normal(size=3)
    still = reaches[0].frames
    poses = [frame_pose(each.at(0), layout) for each in still]
    moved = [
        move_frame(each.at(0), layout, Pose(pose.position + shift, pose.quaternion))
        for each, pose in zip(still, poses, strict=True)
    ]
    first, second = (compute_reproduction(reach_skill, frames).reproduction for frames in (still, moved))
    assert first
    assert second
    np.testing.assert_allclose(second.motion.x[:, :3], first.motion.x[:, :3] + shift, atol=1e-8)


def test_sphere_demonstrations_have_poses(reach_demonstrations: tuple[Demonstration, ...]):
    demo = to_sphere(reach_demonstrations[0])
    np.testing.assert_allclose(
        frame_pose(demo.frames[1].at(0), demo.layout).position, demo.frames[1].at(0).b[:3]
    )


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_move_frame_refuses_bad_input():
    layout, given = position_layout(3), frame("cup", np.eye(3), np.zeros(3))
    good = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    for bad in (np.nan * np.ones(3), np.zeros(2), np.full(3, np.inf)):
        with pytest.raises(InvalidInput):
            move_frame(given, layout, Pose(bad, good.quaternion))
    with pytest.raises(InvalidInput, match="norm"):
        move_frame(given, layout, Pose(np.zeros(3), np.zeros(4)))
    with pytest.raises(InvalidInput, match="array"):
        move_frame(given, pose_layout(), good)
    with pytest.raises(InvalidInput, match="expected a position"):
        frame_pose(frame("cup", np.eye(1), np.zeros(1)), Layout((GRIP,)))
