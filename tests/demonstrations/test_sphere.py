"""Orientations as points of S^3: signs mean nothing, frames multiply from the left, speeds are body rates."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Frame,
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    diagnose,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    resample,
    tangent_map,
    to_sphere,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, exp_map, log_map, multiply, normalise, quaternion_exp, rotation_matrix

SPHERE = Layout((pose_layout().parts[0], replace(pose_layout().parts[1], quantity=Quantity.ORIENTATION)))
FLIPPED = np.array([1.0, 1, 1, -1, -1, -1, -1])


@pytest.fixture
def poses(rng):
    """A smooth movement of a tool, 40 rows."""
    s = np.linspace(0.0, 1.0, 40)[:, None]
    turn = multiply(quaternion_exp(s * rng.normal(size=3)), quaternion_exp(s**2 * rng.normal(size=3)))
    return np.hstack([np.sin(s * rng.normal(size=3)), multiply(turn, quaternion_exp(rng.normal(size=3)))])


def some_pose(rng):
    return Pose(rng.normal(size=3), quaternion_exp(rng.normal(size=3)))


def recorded(poses, rng, layout=None):
    layout = layout or pose_layout()
    return demonstration(poses, 0.1, layout, [frame_from_pose("object", layout, some_pose(rng))], "a")


def test_deviations_have_three_columns_for_an_orientation():
    layout = SPHERE.differentiate()
    assert SPHERE.orientation_starts == layout.orientation_starts == (3,)
    assert (SPHERE.width, SPHERE.tangent.width) == (7, 6)
    assert (layout.width, layout.tangent.width) == (13, 12)
    assert layout.units == ("m",) * 3 + ("1",) * 4 + ("m/s",) * 3 + ("rad/s",) * 3
    assert layout.tangent.units == ("m",) * 3 + ("rad",) * 3 + ("m/s",) * 3 + ("rad/s",) * 3
    assert layout.tangent.tangent == layout.tangent == SPHERE.tangent.differentiate()


def test_the_derivative_of_an_orientation_is_no_point_of_the_sphere():
    with pytest.raises(InvalidInput, match="angular velocity in body axes"):
        Part("orientation", Quantity.ORIENTATION, 4, "1", derivative=1)


def test_rates_take_each_row_to_the_next(poses, rng):
    """x[t+1] = x[t] exp(period v[t] / 2), whatever signs the rows have."""
    signs = np.where(rng.uniform(size=(40, 1)) < 0.5, FLIPPED, 1.0)
    for given in (poses, signs * poses):
        demo = add_derivatives(recorded(given, rng, SPHERE))
        reached = exp_map(given[:-1], 0.1 * demo.x[:-1, 7:], (3,))
        np.testing.assert_allclose(log_map(reached, given[1:], (3,)), 0.0, atol=1e-13)
        np.testing.assert_array_equal(demo.x[-1, 7:], demo.x[-2, 7:])


def test_going_to_the_sphere_and_differentiating_commute(poses, rng):
    """2 q* q' of a difference quotient is the rotation vector's sine: equal to third order in the angle."""
    flat = recorded(poses, rng)
    one, other = to_sphere(add_derivatives(flat)), add_derivatives(to_sphere(flat))
    assert one.layout == other.layout
    angles = np.linalg.norm(other.x[:, 10:], axis=1, keepdims=True) * 0.1
    assert angles.max() > 0.01
    assert np.all(np.abs(one.x - other.x)[:, 10:] <= angles**3 / 0.1 / 20)
    np.testing.assert_allclose(one.x[:, :10], other.x[:, :10], atol=1e-12)
    for a, b in zip(one.frames, other.frames, strict=True):
        np.testing.assert_allclose(a.A, b.A, atol=1e-12)
        np.testing.assert_array_equal(a.b, b.b)


def test_what_lies_on_the_sphere_stays(poses, rng):
    demo = to_sphere(add_derivatives(recorded(poses, rng)))
    again = to_sphere(demo)
    assert again.layout == demo.layout
    np.testing.assert_allclose(again.x, demo.x, atol=1e-15)


def test_a_standing_frame_leaves_body_rates_as_they_are(poses, rng):
    """Deviations of what it sees are those in the world: places turned back, orientations untouched."""
    demo = add_derivatives(recorded(poses, rng, SPHERE))
    seen, frame = views([demo]).x[0], demo.frames[0]
    np.testing.assert_allclose(seen[:, 10:], demo.x[:, 10:], atol=1e-13)
    world = log_map(demo.x[:-1], demo.x[1:], (3,))
    np.testing.assert_allclose(
        log_map(seen[:-1], seen[1:], (3,)) @ tangent_map(frame.A, (3,)).T, world, atol=1e-12
    )


@pytest.mark.parametrize("sphere_first", [True, False])
def test_what_a_moving_frame_sees_turn_is_the_difference_of_what_it_sees(poses, rng, sphere_first):
    """A cup on a turning belt is at rest there, and the hand's rates are those relative to the belt."""
    axis = 0.3 * rng.normal(size=3)
    belt = [Pose(0.02 * t * np.ones(3), quaternion_exp(0.05 * t * axis)) for t in range(40)]
    still = np.array([0.1, 0.2, 0.0, *quaternion_exp(np.array([0.4, 0.0, 0.0]))])
    carried = np.array(
        [
            np.append(
                p.position + rotation_matrix(p.quaternion) @ still[:3], multiply(p.quaternion, still[3:])
            )
            for p in belt
        ]
    )
    layout = SPHERE if sphere_first else pose_layout()
    for x in (carried, poses):
        demo = add_derivatives(demonstration(x, 0.1, layout, [moving_frame_from_poses("belt", layout, belt)]))
        seen = views([demo if sphere_first else to_sphere(demo)]).x[0]
        rates = log_map(seen[:-1, :7], seen[1:, :7], (3,)) / 0.1
        fastest = np.linalg.norm(rates[:, 3:], axis=1).max()
        accurate = 1e-10 if sphere_first else fastest**3 * 0.1**2 / 20 + 1e-12
        np.testing.assert_allclose(seen[:-1, 7:], rates, atol=accurate)


def test_resampling_does_not_see_signs(poses, rng):
    signs = np.where(rng.uniform(size=(40, 1)) < 0.5, FLIPPED, 1.0)
    one, other = (resample(recorded(x, rng, SPHERE), 73) for x in (poses, signs * poses))
    np.testing.assert_allclose(log_map(one.x, other.x, (3,)), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(other.x[:, 3:], axis=1), 1.0)
    ends = log_map(other.x[[0, -1]], poses[[0, -1]], (3,))
    np.testing.assert_allclose(ends, 0.0, atol=1e-12)


def test_a_resampled_moving_frame_still_turns(rng, poses):
    """Though its poses flip sign on the way."""
    belt = [
        Pose(np.zeros(3), (-1.0) ** (t > 7) * quaternion_exp(np.array([0.0, 0.02 * t, 0.0])))
        for t in range(40)
    ]
    frame = moving_frame_from_poses("belt", SPHERE, belt)
    frame.A[20:, 3:, 3:] *= -1.0
    demo = resample(demonstration(poses, 0.1, SPHERE, [frame]), 25)
    expected = rotation_matrix(demo.frames[0].A[:, 3:, 3])
    np.testing.assert_allclose(demo.frames[0].A[:, :3, :3], expected, atol=1e-3)


def test_a_change_of_sign_is_no_jump(poses, rng):
    signs = np.where(rng.uniform(size=(40, 1)) < 0.5, FLIPPED, 1.0)
    assert diagnose([recorded(signs * poses, rng, SPHERE)]) == diagnose([recorded(poses, rng, SPHERE)])


def test_lengths_and_frames_that_leave_the_sphere_are_refused(poses, rng):
    with pytest.raises(InvalidInput, match=r"has norm 2"):
        demonstration(poses * 2.0, 0.1, SPHERE)
    turn = frame_from_pose("object", SPHERE, some_pose(rng))
    mixed, moved, scaled, mirrored = turn.A.copy(), turn.b.copy(), turn.A.copy(), turn.A.copy()
    mixed[0, 4], moved[4] = 0.1, 0.1
    scaled[3:, 3:] *= 1.01
    mirrored[:, 6] *= -1.0
    for A, b in ((mixed, turn.b), (turn.A, moved), (scaled, turn.b), (mirrored, turn.b), (mixed.T, turn.b)):
        with pytest.raises(InvalidInput, match="unit quaternion from the left"):
            demonstration(poses, 0.1, SPHERE, [Frame("object", A, b)])


def test_what_cannot_go_to_the_sphere_is_refused(poses, rng):
    places = demonstration(poses[:, :3], 0.1, Layout(SPHERE.parts[:1]))
    with pytest.raises(InvalidInput, match="expected a quaternion"):
        to_sphere(places)
    twice = Layout((pose_layout().parts[1], replace(pose_layout().parts[1], derivative=2)))
    with pytest.raises(InvalidInput, match="at most its first derivative"):
        to_sphere(demonstration(np.hstack([poses[:, 3:]] * 2), 0.1, twice))
    demo = add_derivatives(recorded(poses, rng))
    other = demo.frames[0].A.copy()
    other[10:, 10:] = np.eye(4)
    with pytest.raises(InvalidInput, match="differently"):
        to_sphere(replace(demo, frames=(replace(demo.frames[0], A=other),)))


def test_rounded_quaternions_come_to_length_one(poses, rng):
    demo = to_sphere(recorded(np.round(poses, 4) * np.array([1, 1, 1] + [1.0005] * 4), rng))
    np.testing.assert_allclose(np.linalg.norm(demo.x[:, 3:], axis=1), 1.0, atol=1e-15)
    np.testing.assert_allclose(demo.x[:, 3:], normalise(np.round(poses, 4)[:, 3:]), atol=1e-12)
