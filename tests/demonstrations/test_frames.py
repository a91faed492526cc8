"""Frames: local coordinates do not change if the whole scene is transformed."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
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


def transform_by_definition(layout: Layout, pose: Pose, row: np.ndarray) -> np.ndarray:
    """Transform a local row to the world, quantity by quantity."""
    world = row.copy()
    R = rotation_matrix(pose.quaternion)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        match part.quantity:
            case Quantity.POSITION:
                world[columns] = R @ row[columns] + (pose.position if part.derivative == 0 else 0.0)
            case Quantity.VECTOR:
                world[columns] = R @ row[columns]
            case Quantity.QUATERNION:
                world[columns] = multiply(pose.quaternion, row[columns])
    return world


def test_frame_from_pose_each_quantity_equals_definition(make):
    """Positions are rotated and translated, vectors and rates rotated, quaternions multiplied."""
    layout, pose = make.mixed.differentiate(), make.pose()
    given, row = frame_from_pose("cup", layout, pose), make.rng.normal(size=layout.width)
    np.testing.assert_allclose(
        given.A @ row + given.b, transform_by_definition(layout, pose, row), atol=1e-14
    )


def test_moving_frame_from_poses_at_step_equals_frame_from_pose(make):
    """The frame at step t is the frame of pose t."""
    poses = make.poses(5)
    moving = moving_frame_from_poses("belt", make.mixed, poses)
    for t, pose in enumerate(poses):
        expected = frame_from_pose("belt", make.mixed, pose)
        np.testing.assert_array_equal(moving.at(t).A, expected.A)
        np.testing.assert_array_equal(moving.at(t).b, expected.b)


def transform_scene(demo: Demonstration, pose: Pose) -> Demonstration:
    """Transform the recording and its frames by a pose."""
    whole = frame_from_pose("scene", demo.layout, pose)
    frames = []
    for given in demo.frames:
        frames.append(replace(given, A=whole.A @ given.A, b=given.b @ whole.A.T + whole.b))
    return demonstration(demo.x @ whole.A.T + whole.b, demo.period, demo.layout, frames, demo.name)


@pytest.mark.parametrize("moving", [False, True])
def test_views_transformed_scene_is_unchanged(make, moving: bool):
    """Local coordinates depend only on relative poses."""
    demo = make(layout=make.mixed, moving=moving)
    np.testing.assert_allclose(views([transform_scene(demo, make.pose())]).x, views([demo]).x, atol=1e-12)


@pytest.mark.parametrize("moving", [False, True])
def test_views_mapped_to_world_equal_recording(make, moving: bool):
    """A x[j] + b = world at each step; views are concatenated, quaternions up to sign."""
    demonstrations = [make(steps, make.mixed, moving=moving) for steps in (2, 9, 4)]
    joint = views(demonstrations)
    assert joint.lengths.tolist() == [2, 9, 4]
    assert joint.x.shape == (2, 15, make.mixed.width)
    assert joint.x.flags.c_contiguous
    separate = [views([demo]).x for demo in demonstrations]
    np.testing.assert_array_equal(np.abs(joint.x), np.abs(np.concatenate(separate, axis=1)))
    for demo, x in zip(demonstrations, separate, strict=True):
        for j, given in enumerate(demo.frames):
            for t in range(len(demo.x)):
                frame_at_t = given.at(t)
                world = frame_at_t.A @ x[j, t] + frame_at_t.b
                np.testing.assert_allclose(world, demo.x[t], atol=1e-12)


def test_views_static_frame_equals_constant_moving_frame(make):
    """Static and moving frames give the same views."""
    demo = make(steps=6)
    frames = [moving_frame(f.name, np.tile(f.A, (6, 1, 1)), np.tile(f.b, (6, 1))) for f in demo.frames]
    other = demonstration(demo.x, demo.period, demo.layout, frames)
    np.testing.assert_allclose(views([demo]).x, views([other]).x, atol=1e-13)


def test_views_world_frame_equals_recording(make):
    """Without frames there is one view, which is x."""
    demo = demonstration(make.x(make.mixed, 5), 0.1, make.mixed)
    assert [given.name for given in demo.frames] == ["world"]
    np.testing.assert_array_equal(views([demo]).x[0], demo.x)
    np.testing.assert_array_equal(world_frame(3).A, np.eye(3))


def test_views_oblique_frame_is_inverted(make):
    """A is any invertible matrix."""
    layout, A, b = position_layout(), make.rng.normal(size=(3, 3)), make.rng.normal(size=3)
    x = make.rng.normal(size=(4, 3))
    demo = demonstration(x @ A.T + b, 0.1, layout, [frame("oblique", A, b)])
    np.testing.assert_allclose(views([demo]).x[0], x, atol=1e-11)


def test_add_derivatives_static_frame_repeats_matrix(make):
    """A static frame extended by derivatives equals the frame built for the longer layout."""
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


def test_views_static_frame_commute_with_add_derivatives(make):
    """For static frames, differentiation and change of frame commute."""
    demo = make(steps=8)
    D = demo.layout.width
    joint, before = views([add_derivatives(demo)]).x, views([demo]).x
    np.testing.assert_allclose(joint[:, :-1, D:], np.diff(before, axis=1) / demo.period, atol=1e-11)


def test_frame_from_pose_fewer_than_three_axes_is_refused(make):
    """The message proposes to pass A and b."""
    with pytest.raises(InvalidInput, match=r"'position' has 2 axes, expected 3.*pass A and b"):
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
def test_frame_unusable_arrays_are_refused(A: object, b: object, message: str):
    """Shapes, finiteness and invertibility are checked; the message names the frame."""
    with pytest.raises(InvalidInput, match=message):
        frame("cup", A, b)


def test_moving_frame_singular_step_is_named():
    """The message gives the step, counted from 0."""
    A = np.tile(np.eye(2), (5, 1, 1))
    A[3, 1, 1] = 0.0
    with pytest.raises(InvalidInput, match=r"moving frame 'belt': A at step 3 .*is singular"):
        moving_frame("belt", A, np.zeros((5, 2)))
    with pytest.raises(InvalidInput, match=r"expected A \(T, D, D\) and b \(T, D\)"):
        moving_frame("belt", A, np.zeros((4, 2)))


@pytest.mark.parametrize("name", ["", " cup", "a\nb"])
def test_frame_unusable_name_is_refused(name: str):
    """Frames are identified by name."""
    with pytest.raises(InvalidInput, match="the name of a frame is"):
        frame(name, np.eye(2), np.zeros(2))


def test_views_incompatible_demonstrations_are_refused(make):
    """Layout, period and frame names must agree; the message says which differs."""
    demo = make()
    other_frames = demonstration(demo.x, demo.period, demo.layout, demo.frames[::-1], "b")
    slower = demonstration(demo.x, 2 * demo.period, demo.layout, demo.frames, "b")
    for other, what in [(other_frames, "frames"), (slower, "period"), (make(layout=make.mixed), "layout")]:
        with pytest.raises(
            InvalidInput, match=rf"demonstration 1 \('.'\) and the first \('a'\) differ in {what}"
        ):
            views([demo, other])
    with pytest.raises(InvalidInput, match="demonstrations is empty"):
        views([])


def test_views_pose_frames_keep_unit_norms(make):
    """A frame from a pose maps unit quaternions to unit quaternions."""
    demo = make()
    columns = pose_layout().columns("orientation")
    np.testing.assert_allclose(np.linalg.norm(views([demo]).x[..., columns], axis=-1), 1.0, atol=1e-13)


def test_is_world_identity_is_true_for_any_name(make):
    """A static frame with A = 1 and b = 0 is the world frame; a moving one is not."""
    assert frame("cup", np.eye(3), np.zeros(3)).is_world
    assert not frame("cup", np.eye(3), [0.0, 0.0, 0.1]).is_world
    assert not frame_from_pose("cup", pose_layout(), make.pose()).is_world
    assert not moving_frame("belt", np.tile(np.eye(2), (4, 1, 1)), np.zeros((4, 2))).is_world


def test_tangent_map_orientation_block_is_identity(make):
    """Deviations of vector columns transform by A, those of orientations on S^3 stay."""
    layout = Layout((Part("position", Quantity.POSITION, 3, "m"), Part("tool", Quantity.ORIENTATION, 4, "1")))
    pose = make.pose()
    matrix = frame_from_pose("cup", layout, pose).tangent_map(layout)
    np.testing.assert_array_equal(matrix[:3, :3], rotation_matrix(pose.quaternion))
    np.testing.assert_array_equal(matrix[3:, 3:], np.eye(3))
    assert not matrix[:3, 3:].any()
    assert not matrix[3:, :3].any()
