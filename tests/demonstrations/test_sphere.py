"""Orientations on S^3: q and -q are equal, frames multiply from the left, velocities are in body axes."""

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
    to_sphere,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, exp_map, log_map, multiply, normalise, quaternion_exp, rotation_matrix

SPHERE = Layout((pose_layout().parts[0], replace(pose_layout().parts[1], quantity=Quantity.ORIENTATION)))
FLIPPED = np.array([1.0, 1, 1, -1, -1, -1, -1])


@pytest.fixture
def poses(rng):
    """Return a smooth movement of a tool, 40 rows."""
    s = np.linspace(0.0, 1.0, 40)[:, None]
    turn = multiply(quaternion_exp(s * rng.normal(size=3)), quaternion_exp(s**2 * rng.normal(size=3)))
    return np.hstack([np.sin(s * rng.normal(size=3)), multiply(turn, quaternion_exp(rng.normal(size=3)))])


def random_pose(rng):
    return Pose(rng.normal(size=3), quaternion_exp(rng.normal(size=3)))


def record(poses, rng, layout=None):
    layout = layout or pose_layout()
    return demonstration(poses, 0.1, layout, [frame_from_pose("object", layout, random_pose(rng))], "a")


def test_tangent_layout_orientation_has_three_columns():
    layout = SPHERE.differentiate()
    assert SPHERE.orientation_starts == layout.orientation_starts == (3,)
    assert (SPHERE.width, SPHERE.tangent.width) == (7, 6)
    assert (layout.width, layout.tangent.width) == (13, 12)
    assert layout.units == ("m",) * 3 + ("1",) * 4 + ("m/s",) * 3 + ("rad/s",) * 3
    assert layout.tangent.units == ("m",) * 3 + ("rad",) * 3 + ("m/s",) * 3 + ("rad/s",) * 3
    assert layout.tangent.tangent == layout.tangent == SPHERE.tangent.differentiate()


def test_part_derivative_of_orientation_is_refused():
    with pytest.raises(InvalidInput, match="angular velocity in body axes"):
        Part("orientation", Quantity.ORIENTATION, 4, "1", derivative=1)


def test_add_derivatives_sphere_integrates_to_next_row(poses, rng):
    """x[t+1] = x[t] exp(period v[t] / 2) for any signs of the rows."""
    signs = np.where(rng.uniform(size=(40, 1)) < 0.5, FLIPPED, 1.0)
    for given in (poses, signs * poses):
        demo = add_derivatives(record(given, rng, SPHERE))
        reached = exp_map(given[:-1], 0.1 * demo.x[:-1, 7:], (3,))
        np.testing.assert_allclose(log_map(reached, given[1:], (3,)), 0.0, atol=1e-13)
        np.testing.assert_array_equal(demo.x[-1, 7:], demo.x[-2, 7:])


def test_to_sphere_commutes_with_add_derivatives(poses, rng):
    """2 q* q' of a difference is the sine of the rotation vector: equal to third order in the angle."""
    flat = record(poses, rng)
    before, after = to_sphere(add_derivatives(flat)), add_derivatives(to_sphere(flat))
    assert before.layout == after.layout
    angles = np.linalg.norm(after.x[:, 10:], axis=1, keepdims=True) * 0.1
    assert angles.max() > 0.01
    assert np.all(np.abs(before.x - after.x)[:, 10:] <= angles**3 / 0.1 / 20)
    np.testing.assert_allclose(before.x[:, :10], after.x[:, :10], atol=1e-12)
    for a, b in zip(before.frames, after.frames, strict=True):
        np.testing.assert_allclose(a.A, b.A, atol=1e-12)
        np.testing.assert_array_equal(a.b, b.b)


def test_to_sphere_twice_is_idempotent(poses, rng):
    demo = to_sphere(add_derivatives(record(poses, rng)))
    again = to_sphere(demo)
    assert again.layout == demo.layout
    np.testing.assert_allclose(again.x, demo.x, atol=1e-15)


def test_views_static_frame_keeps_angular_velocity(poses, rng):
    """Local deviations are those in the world: positions rotated, orientations unchanged."""
    demo = add_derivatives(record(poses, rng, SPHERE))
    local, frame = views([demo]).x[0], demo.frames[0]
    np.testing.assert_allclose(local[:, 10:], demo.x[:, 10:], atol=1e-13)
    world = log_map(demo.x[:-1], demo.x[1:], (3,))
    np.testing.assert_allclose(
        log_map(local[:-1], local[1:], (3,)) @ frame.tangent_map(demo.layout).T, world, atol=1e-12
    )


@pytest.mark.parametrize("sphere_first", [True, False])
def test_views_moving_frame_rates_are_differences_of_local_points(poses, rng, sphere_first):
    """A cup on a rotating belt is at rest in its frame; local rates are differences of local points."""
    axis = 0.3 * rng.normal(size=3)
    belt = [Pose(0.02 * t * np.ones(3), quaternion_exp(0.05 * t * axis)) for t in range(40)]
    at_rest = np.array([0.1, 0.2, 0.0, *quaternion_exp(np.array([0.4, 0.0, 0.0]))])
    carried = np.array(
        [
            np.append(
                p.position + rotation_matrix(p.quaternion) @ at_rest[:3], multiply(p.quaternion, at_rest[3:])
            )
            for p in belt
        ]
    )
    layout = SPHERE if sphere_first else pose_layout()
    for x in (carried, poses):
        demo = add_derivatives(demonstration(x, 0.1, layout, [moving_frame_from_poses("belt", layout, belt)]))
        local = views([demo if sphere_first else to_sphere(demo)]).x[0]
        rates = log_map(local[:-1, :7], local[1:, :7], (3,)) / 0.1
        fastest = np.linalg.norm(rates[:, 3:], axis=1).max()
        tolerance = 1e-10 if sphere_first else fastest**3 * 0.1**2 / 20 + 1e-12
        np.testing.assert_allclose(local[:-1, 7:], rates, atol=tolerance)


def test_resample_sphere_is_independent_of_signs(poses, rng):
    signs = np.where(rng.uniform(size=(40, 1)) < 0.5, FLIPPED, 1.0)
    first, second = (resample(record(x, rng, SPHERE), 73) for x in (poses, signs * poses))
    np.testing.assert_allclose(log_map(first.x, second.x, (3,)), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(second.x[:, 3:], axis=1), 1.0)
    ends = log_map(second.x[[0, -1]], poses[[0, -1]], (3,))
    np.testing.assert_allclose(ends, 0.0, atol=1e-12)


def test_resample_moving_frame_remains_rotation(rng, poses):
    """Its poses change sign at some steps."""
    belt = [
        Pose(np.zeros(3), (-1.0) ** (t > 7) * quaternion_exp(np.array([0.0, 0.02 * t, 0.0])))
        for t in range(40)
    ]
    frame = moving_frame_from_poses("belt", SPHERE, belt)
    frame.A[20:, 3:, 3:] *= -1.0
    demo = resample(demonstration(poses, 0.1, SPHERE, [frame]), 25)
    expected = rotation_matrix(demo.frames[0].A[:, 3:, 3])
    np.testing.assert_allclose(demo.frames[0].A[:, :3, :3], expected, atol=1e-3)


def test_diagnose_sign_changes_on_sphere_are_not_jumps(poses, rng):
    signs = np.where(rng.uniform(size=(40, 1)) < 0.5, FLIPPED, 1.0)
    assert diagnose([record(signs * poses, rng, SPHERE)]) == diagnose([record(poses, rng, SPHERE)])


def test_demonstration_norms_and_frames_off_sphere_are_refused(poses, rng):
    with pytest.raises(InvalidInput, match=r"has norm 2"):
        demonstration(poses * 2.0, 0.1, SPHERE)
    turn = frame_from_pose("object", SPHERE, random_pose(rng))
    mixed, moved, scaled, mirrored = turn.A.copy(), turn.b.copy(), turn.A.copy(), turn.A.copy()
    mixed[0, 4], moved[4] = 0.1, 0.1
    scaled[3:, 3:] *= 1.01
    mirrored[:, 6] *= -1.0
    for A, b in ((mixed, turn.b), (turn.A, moved), (scaled, turn.b), (mirrored, turn.b), (mixed.T, turn.b)):
        with pytest.raises(InvalidInput, match="left multiplication by a unit quaternion"):
            demonstration(poses, 0.1, SPHERE, [Frame("object", A, b)])


def test_to_sphere_unusable_layout_or_frame_is_refused(poses, rng):
    places = demonstration(poses[:, :3], 0.1, Layout(SPHERE.parts[:1]))
    with pytest.raises(InvalidInput, match="expected a quaternion"):
        to_sphere(places)
    twice = Layout((pose_layout().parts[1], replace(pose_layout().parts[1], derivative=2)))
    with pytest.raises(InvalidInput, match="at most its first derivative"):
        to_sphere(demonstration(np.hstack([poses[:, 3:]] * 2), 0.1, twice))
    demo = add_derivatives(record(poses, rng))
    other = demo.frames[0].A.copy()
    other[10:, 10:] = np.eye(4)
    with pytest.raises(InvalidInput, match="differently"):
        to_sphere(replace(demo, frames=(replace(demo.frames[0], A=other),)))


def test_to_sphere_rounded_quaternions_are_normalised(poses, rng):
    demo = to_sphere(record(np.round(poses, 4) * np.array([1, 1, 1] + [1.0005] * 4), rng))
    np.testing.assert_allclose(np.linalg.norm(demo.x[:, 3:], axis=1), 1.0, atol=1e-15)
    np.testing.assert_allclose(demo.x[:, 3:], normalise(np.round(poses, 4)[:, 3:]), atol=1e-12)
