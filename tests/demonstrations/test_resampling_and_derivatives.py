"""Derivatives and resampling of demonstrations."""

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    pose_layout,
    resample,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import multiply, quaternion_exp


def test_add_derivatives_integrates_to_next_row(make):
    """x[t+1] = x[t] + period v[t]; the last v is repeated, and the points are unchanged."""
    demo = make(layout=make.mixed)
    longer, D = add_derivatives(demo), make.mixed.width
    x, v = longer.x[:, :D], longer.x[:, D:]
    np.testing.assert_array_equal(x, demo.x)
    np.testing.assert_allclose(x[:-1] + demo.period * v[:-1], x[1:], atol=1e-14)
    np.testing.assert_array_equal(v[-1], v[-2])
    assert longer.layout == make.mixed.differentiate()
    assert (longer.period, longer.name) == (demo.period, demo.name)


def test_add_derivatives_twice_is_refused(make):
    """A layout has derivatives once."""
    with pytest.raises(InvalidInput, match="already"):
        add_derivatives(add_derivatives(make()))


@pytest.mark.parametrize("steps", [7, 20, 61, 400])
def test_resample_column_that_switches_takes_no_other_value(steps: int):
    """It closes and opens once, at the times of the recording, and its derivative adds up to the changes."""
    layout = Layout((Part("position", Quantity.POSITION, 1, "m"), Part("gripper", Quantity.SCALAR, 1, "1")))
    gripper = np.where((np.arange(61) >= 20) & (np.arange(61) < 50), 0.8, -1.0)
    recorded = demonstration(np.column_stack([np.arange(61.0), gripper]), 0.1, layout, (), "one")
    demo = resample(add_derivatives(recorded), steps)
    closed = demo.x[:, 1] > 0.0
    assert set(demo.x[:, 1]) == {-1.0, 0.8}
    assert np.abs(np.diff(closed.astype(int))).sum() == 2
    times = demo.period * (np.flatnonzero(closed[1:] != closed[:-1]) + 1)
    np.testing.assert_allclose(times, [2.0, 5.0], atol=demo.period + 0.05)
    np.testing.assert_allclose(demo.x[:-1, 1] + demo.period * demo.x[:-1, 3], demo.x[1:, 1], atol=1e-12)


@pytest.mark.parametrize("steps", [2, 7, 23, 230])
def test_resample_keeps_ends_duration_and_norms(make, steps: int):
    """Ends, duration and unit norms are kept."""
    demo = make(steps=23, moving=True)
    other = resample(demo, steps)
    assert len(other.x) == steps
    np.testing.assert_allclose(other.x[[0, -1]], demo.x[[0, -1]], atol=1e-15)
    np.testing.assert_allclose(other.period * (steps - 1), demo.period * 22, rtol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(other.x[:, 3:], axis=1), 1.0, atol=1e-15)
    np.testing.assert_allclose(other.frames[1].A[-1], demo.frames[1].A[-1], atol=1e-14)


def test_resample_same_steps_is_identity(make):
    """The same number of rows gives the same rows."""
    demo = make(steps=9, moving=True)
    same = resample(demo, 9)
    np.testing.assert_allclose(same.x, demo.x, atol=1e-15)
    np.testing.assert_array_equal(same.frames[1].b, demo.frames[1].b)


def test_resample_columns_equal_numpy_interp(make):
    """Every column equals numpy.interp."""
    demo = make(steps=11, layout=Layout((Part("joints", Quantity.SCALAR, 4, "rad"),)).differentiate())
    other = resample(demo, 28)
    new_times, times = np.linspace(0, 1, 28), np.linspace(0, 1, 11)
    expected = np.stack([np.interp(new_times, times, column) for column in demo.x.T], axis=1)
    np.testing.assert_allclose(other.x, expected, atol=1e-14)


def test_resample_midpoint_of_quaternions_is_half_rotation(make):
    """The midpoint of two quaternions is half the rotation, by symmetry."""
    p = make.quaternions(1)[0]
    q = multiply(p, quaternion_exp(np.array([0.2, -0.1, 0.3])))
    demo = demonstration([[0, 0, 0, *p], [0, 0, 0, *q]], 0.1, pose_layout())
    middle = resample(demo, 3).x[1, 3:]
    np.testing.assert_allclose(middle, multiply(p, quaternion_exp(np.array([0.1, -0.05, 0.15]))), atol=1e-14)


@pytest.mark.parametrize("steps", [1, 0, -3])
def test_resample_fewer_than_two_steps_is_refused(make, steps: int):
    """The message gives the number."""
    with pytest.raises(InvalidInput, match=f"steps is {steps}"):
        resample(make(), steps)
