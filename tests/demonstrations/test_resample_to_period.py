"""Resampling to the period of a controller: closed forms of a line, a rotation and a switch."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    resample_to_period,
    to_sphere,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, normalise

POSE = (Part("position", Quantity.POSITION, 3, "m"), Part("orientation", Quantity.QUATERNION, 4, "1"))
GRIPPER = Part("gripper", Quantity.SCALAR, 1, "1")


def random_reach(rng: np.random.Generator, steps: int = 21, period: float = 0.1) -> Demonstration:
    """Return a motion with large turns between rows, and a gripper that closes at row 8."""
    layout = Layout((*POSE, GRIPPER))
    turns = Rotation.from_rotvec(np.cumsum(rng.uniform(-0.4, 0.4, (steps, 3)), axis=0))
    q = np.roll(turns.as_quat(), 1, axis=1)
    q[1:] *= np.cumprod(np.sign(np.einsum("td,td->t", q[1:], q[:-1])))[:, None]
    x = np.hstack([rng.normal(size=(steps, 3)), q, (np.arange(steps) >= 8)[:, None]])
    cup = frame_from_pose("cup", layout, Pose(rng.normal(size=3), normalise(rng.normal(size=4))))
    return demonstration(x, period, layout, [cup], "reach")


def test_numbers_and_rotations_equal_scipy(rng: np.random.Generator):
    demo = random_reach(rng)
    resampled = resample_to_period(demo, 0.016)
    old, new = 0.1 * np.arange(21), 0.016 * np.arange(126)
    assert resampled.x.shape == (126, 8)
    for column in range(3):
        np.testing.assert_allclose(resampled.x[:, column], np.interp(new, old, demo.x[:, column]), atol=1e-12)
    turns = Rotation.from_quat(np.roll(demo.x[:, 3:7], -1, axis=1))
    expected = Slerp(old, turns)(np.minimum(new, old[-1]))
    found = Rotation.from_quat(np.roll(resampled.x[:, 3:7], -1, axis=1))
    assert (found * expected.inv()).magnitude().max() < 1e-7
    assert set(resampled.x[:, 7]) == {0.0, 1.0}
    assert new[np.argmax(resampled.x[:, 7])] == pytest.approx(0.752)  # the first time nearer to row 8
    np.testing.assert_array_equal(resampled.frames[0].A, demo.frames[0].A)
    assert (resampled.period, resampled.name) == (0.016, "reach")


def test_rows_of_the_source_are_exact(rng: np.random.Generator):
    demo = random_reach(rng)
    np.testing.assert_array_equal(resample_to_period(demo, 0.02).x[::5], demo.x)
    assert resample_to_period(demo, 0.1) is demo
    coarse = resample_to_period(demo, 0.3)
    np.testing.assert_array_equal(coarse.x[:, :7], demo.x[:19:3, :7])


def test_derivatives_are_computed_again(rng: np.random.Generator):
    demo = random_reach(rng)
    for plain in (demo, to_sphere(demo)):
        resampled = resample_to_period(add_derivatives(plain), 0.025)
        expected = add_derivatives(resample_to_period(plain, 0.025))
        assert resampled.layout == expected.layout
        np.testing.assert_array_equal(resampled.x, expected.x)
        np.testing.assert_array_equal(resampled.frames[0].A, expected.frames[0].A)


def test_derivatives_of_some_parts_are_left_out():
    layout = Layout(
        (
            Part("position", Quantity.POSITION, 1, "m"),
            GRIPPER,
            Part("position", Quantity.POSITION, 1, "m/s", 1),
        )
    )
    demo = demonstration(np.arange(12.0).reshape(4, 3), 0.1, layout)
    assert resample_to_period(demo, 0.05).layout == Layout(layout.parts[:2])
    assert resample_to_period(demo, 0.1) is demo


def test_moving_frame_follows_between_rows():
    layout = Layout(POSE[:1])
    poses = [Pose(np.array([0.1 * t, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])) for t in range(5)]
    frame = moving_frame_from_poses("belt", layout, poses)
    demo = demonstration(np.zeros((5, 3)), 0.1, layout, [frame])
    (moved,) = resample_to_period(demo, 0.04).frames
    np.testing.assert_allclose(moved.b[:, 0], 0.04 * np.arange(11), atol=1e-12)


@pytest.mark.parametrize("period", [0.0, -0.1, np.nan, np.inf, 3.0, 1e-9, "0.1"])
def test_unusable_periods_are_refused(period, unchecked: None):
    with pytest.raises(InvalidInput, match="period"):
        resample_to_period(random_reach(np.random.default_rng(0)), period)
