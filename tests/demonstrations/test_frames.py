"""Frames are where objects stand: what they see does not change when all is moved together."""

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    frame,
    frame_from_pose,
    moving_frame,
    moving_frame_from_poses,
    pose_layout,
    position_layout,
    views,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, multiply, rotation_matrix


def by_definition(layout: Layout, pose: Pose, row: np.ndarray) -> np.ndarray:
    """A row that the object sees, told in the world, quantity by quantity."""
    world = row.copy()
    R = rotation_matrix(pose.quaternion)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        match part.quantity:
            case Quantity.POSITION:
                moves = part.derivative == 0
                world[columns] = R @ row[columns] + (pose.position if moves else 0.0)
            case Quantity.VECTOR:
                world[columns] = R @ row[columns]
            case Quantity.QUATERNION:
                world[columns] = multiply(pose.quaternion, row[columns])
    return world


def test_a_frame_does_to_each_quantity_what_its_pose_does(make):
    """Positions turn and move, vectors and rates turn, quaternions are multiplied, scalars stay."""
    layout, pose = make.mixed.differentiate(), make.pose()
    given, row = frame_from_pose("cup", layout, pose), make.rng.normal(size=layout.width)
    np.testing.assert_allclose(given.A @ row + given.b, by_definition(layout, pose, row), atol=1e-14)


def test_a_moving_frame_is_a_frame_at_each_step(make):
    """at(t) of a moving frame is the frame of the t-th pose."""
    poses = make.poses(5)
    moving = moving_frame_from_poses("belt", make.mixed, poses)
    for t, pose in enumerate(poses):
        expected = frame_from_pose("belt", make.mixed, pose)
        np.testing.assert_array_equal(moving.at(t).A, expected.A)
        np.testing.assert_array_equal(moving.at(t).b, expected.b)


def moved(demo: Demonstration, pose: Pose) -> Demonstration:
    """All of the scene moved by the pose: the recording and its frames."""
    whole = frame_from_pose("scene", demo.layout, pose)
    frames = []
    for given in demo.frames:
        kind = MovingFrame if isinstance(given, MovingFrame) else Frame
        frames.append(kind(given.name, whole.A @ given.A, given.b @ whole.A.T + whole.b))
    return demonstration(demo.x @ whole.A.T + whole.b, demo.period, demo.layout, frames, demo.name)


@pytest.mark.parametrize("moving", [False, True])
def test_moving_recording_and_frames_together_changes_no_view(make, moving: bool):
    """What objects see depends only on how things stand to one another."""
    demo = make(layout=make.mixed, moving=moving)
    np.testing.assert_allclose(views([moved(demo, make.pose())]).x, views([demo]).x, atol=1e-12)


@pytest.mark.parametrize("moving", [False, True])
def test_views_put_back_into_the_world_are_the_recording(make, moving: bool):
    """A x[j] + b = world, step by step; together they lie one after the other, orientations as q or -q."""
    demonstrations = [make(steps, make.mixed, moving=moving) for steps in (2, 9, 4)]
    seen = views(demonstrations)
    assert seen.lengths.tolist() == [2, 9, 4]
    assert seen.x.shape == (2, 15, make.mixed.width)
    assert seen.x.flags.c_contiguous
    alone = [views([demo]).x for demo in demonstrations]
    np.testing.assert_array_equal(np.abs(seen.x), np.abs(np.concatenate(alone, axis=1)))
    for demo, x in zip(demonstrations, alone, strict=True):
        for j, given in enumerate(demo.frames):
            for t in range(len(demo.x)):
                at = given.at(t) if isinstance(given, MovingFrame) else given
                np.testing.assert_allclose(at.A @ x[j, t] + at.b, demo.x[t], atol=1e-12)


def test_a_frame_that_stands_is_a_moving_frame_of_equal_steps(make):
    """The two ways to view agree."""
    demo = make(steps=6)
    frames = [moving_frame(f.name, np.tile(f.A, (6, 1, 1)), np.tile(f.b, (6, 1))) for f in demo.frames]
    other = demonstration(demo.x, demo.period, demo.layout, frames)
    np.testing.assert_allclose(views([demo]).x, views([other]).x, atol=1e-13)


def test_the_world_sees_the_recording_itself(make):
    """Without frames there is one view, and it is x."""
    demo = demonstration(make.x(make.mixed, 5), 0.1, make.mixed)
    assert [given.name for given in demo.frames] == ["world"]
    np.testing.assert_array_equal(views([demo]).x[0], demo.x)
    np.testing.assert_array_equal(world_frame(3).A, np.eye(3))


def test_frames_with_an_oblique_matrix_are_looked_through_exactly(make):
    """A need not be a rotation."""
    layout, A, b = position_layout(), make.rng.normal(size=(3, 3)), make.rng.normal(size=3)
    x = make.rng.normal(size=(4, 3))
    demo = demonstration(x @ A.T + b, 0.1, layout, [frame("oblique", A, b)])
    np.testing.assert_allclose(views([demo]).x[0], x, atol=1e-11)


def test_frames_of_derivatives_turn_them_as_they_turn_the_parts(make):
    """Extending a frame and building it for the longer layout agree, for frames that stand still."""
    demo = make(layout=make.mixed)
    longer = add_derivatives(demo)
    for given, extended in zip(demo.frames, longer.frames, strict=True):
        D = make.mixed.width
        np.testing.assert_array_equal(extended.A[..., :D, :D], given.A)
        np.testing.assert_array_equal(extended.A[..., D:, D:], given.A)
        assert not extended.A[..., :D, D:].any()
        assert not extended.A[..., D:, :D].any()
        np.testing.assert_array_equal(extended.b[..., :D], given.b)
        assert not extended.b[..., D:].any()


def test_views_of_derivatives_are_derivatives_of_views(make):
    """Through frames that stand still, differencing and viewing commute."""
    demo = make(steps=8)
    D = demo.layout.width
    seen, before = views([add_derivatives(demo)]).x, views([demo]).x
    np.testing.assert_allclose(seen[:, :-1, D:], np.diff(before, axis=1) / demo.period, atol=1e-11)


def test_a_plane_is_not_turned_by_a_pose_of_space(make):
    """Two axes: the fix, giving A and b, is named."""
    with pytest.raises(InvalidInput, match=r"'position' has 2 axes, expected 3.*give A and b"):
        frame_from_pose("cup", position_layout(axes=2), make.pose())
    with pytest.raises(InvalidInput, match="'push' has 1 axes"):
        frame_from_pose("cup", Layout((Part("push", Quantity.VECTOR, 1, "N"),)), make.pose())


BAD_FRAMES = [
    (np.eye(3), np.zeros(2), r"A has shape \(3, 3\) and b \(2,\)"),
    (np.zeros((3, 2)), np.zeros(2), r"A has shape \(3, 2\)"),
    (1.0, 1.0, r"A has shape \(\)"),
    (np.zeros((0, 0)), np.zeros(0), r"A has shape \(0, 0\)"),
    (np.diag([1.0, 0.0, 1.0]), np.zeros(3), r"'cup': A is singular \(condition inf\)"),
    (np.diag([1.0, 1e-13, 1.0]), np.zeros(3), r"singular \(condition 1e\+13\)"),
    (np.diag([1.0, np.nan, 1.0]), np.zeros(3), r"'cup': A\[1, 1\] is nan"),
    (np.eye(3), [0, 0, np.inf], r"b\[2\] is inf"),
    ([[1, 0], [0]], [0, 0], "different lengths"),
    (np.eye(2, dtype=complex), [0, 0], "complex128 values"),
    (np.eye(2), ["a", "b"], "b holds 'a', expected an array of real numbers"),
]


@pytest.mark.parametrize(("A", "b", "message"), BAD_FRAMES, ids=range(len(BAD_FRAMES)))
def test_what_cannot_be_looked_through_is_refused(A: object, b: object, message: str):
    """Sizes, finiteness and invertibility are checked, and the frame is named."""
    with pytest.raises(InvalidInput, match=message):
        frame("cup", A, b)


def test_a_moving_frame_is_refused_at_the_step_where_it_is_singular():
    """The step is named, counted from 0."""
    A = np.tile(np.eye(2), (5, 1, 1))
    A[3, 1, 1] = 0.0
    with pytest.raises(InvalidInput, match=r"moving frame 'belt': A at step 3 .*is singular"):
        moving_frame("belt", A, np.zeros((5, 2)))
    with pytest.raises(InvalidInput, match=r"expected A \(T, D, D\) and b \(T, D\)"):
        moving_frame("belt", A, np.zeros((4, 2)))


@pytest.mark.parametrize("name", ["", " cup", "a\nb"])
def test_frames_need_a_name_on_one_line(name: str):
    """Names are what frames are told apart by."""
    with pytest.raises(InvalidInput, match="the name of a frame is"):
        frame(name, np.eye(2), np.zeros(2))


def test_demonstrations_that_differ_are_not_viewed_together(make):
    """Layout, period and names of frames must agree; the message says which differs."""
    demo = make()
    other_frames = demonstration(demo.x, demo.period, demo.layout, demo.frames[::-1], "b")
    slower = demonstration(demo.x, 2 * demo.period, demo.layout, demo.frames, "b")
    for other, what in [(other_frames, "frames"), (slower, "period"), (make(layout=make.mixed), "layout")]:
        with pytest.raises(
            InvalidInput, match=rf"demonstration 1 \('.'\) and the first \('a'\) differ in {what}"
        ):
            views([demo, other])
    with pytest.raises(InvalidInput, match="no demonstrations"):
        views([])


def test_pose_frames_keep_unit_quaternions(make):
    """A frame made of a pose sees unit quaternions as unit quaternions."""
    demo = make()
    columns = pose_layout().columns("orientation")
    np.testing.assert_allclose(np.linalg.norm(views([demo]).x[..., columns], axis=-1), 1.0, atol=1e-13)
