"""Creation of demonstrations: checks and copies of a user's arrays."""

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Frame,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    demonstration,
    frame,
    pose_layout,
    position_layout,
    unwrap_orientations,
    world_frame,
)
from pilotfish.errors import InvalidInput

LINE = np.arange(8.0).reshape(4, 2)
PLANE = position_layout(axes=2)


def test_demonstration_arrays_are_read_only_copies(make):
    """A later change of the user's array has no effect, and the copy is read-only."""
    x, A = LINE.copy(), np.eye(2)
    demo = demonstration(x, 0.1, PLANE, [Frame("cup", A, np.zeros(2))])
    x[:], A[:] = 7.0, 7.0
    np.testing.assert_array_equal(demo.x, LINE)
    np.testing.assert_array_equal(demo.frames[0].A, np.eye(2))
    for array in (demo.x, demo.frames[0].A, demo.frames[0].b):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    "x", [LINE.tolist(), LINE.astype(int), LINE.astype(np.float32), np.asfortranarray(LINE)]
)
def test_demonstration_any_numeric_type_is_accepted(x: object):
    """Lists, integers, single precision and any memory order give the same demonstration."""
    demo = demonstration(x, 0.1, PLANE)
    assert demo.x.dtype == np.float64
    assert demo.x.flags.c_contiguous
    np.testing.assert_array_equal(demo.x, LINE)


NOT_ROWS = [
    ([[0, 1], [2]], "different lengths"),
    (np.array([[0, 1], None], dtype=object), "not real numbers"),
    (np.zeros((0, 2)), r"shape \(0, 2\), expected \(T, 2\) with T of 2 or more"),
    (np.zeros((1, 2)), r"shape \(1, 2\)"),
    (np.zeros(4), r"shape \(4,\)"),
    (np.zeros((2, 2, 2)), r"shape \(2, 2, 2\)"),
    (np.zeros((4, 3)), "has 3 columns, but its layout has 2: position x, position y"),
    (LINE.astype(complex), "complex128 values"),
    (LINE.astype(str), "not real numbers"),
    (LINE > 3, "bool values"),
    (np.ma.masked_greater(LINE, 6), "masked entries"),
    (None, "not real numbers"),
    ("recording.csv", "not real numbers"),
]


@pytest.mark.parametrize(("x", "message"), NOT_ROWS, ids=range(len(NOT_ROWS)))
def test_demonstration_other_than_rows_of_numbers_is_refused(x: object, message: str):
    """The message gives the value and what was expected."""
    with pytest.raises(InvalidInput, match=f"demonstration 'reach'.*{message}"):
        demonstration(x, 0.1, PLANE, name="reach")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_demonstration_value_not_finite_is_located(bad: float):
    """The message gives row, column and number."""
    x = LINE.copy()
    x[2, 1] = x[3, 0] = bad
    with pytest.raises(InvalidInput, match=r"'reach': row 2 .*column 'position y' is .*2 such values"):
        demonstration(x, 0.1, PLANE, name="reach")


@pytest.mark.parametrize("period", [0.0, -0.1, np.nan, np.inf])
def test_demonstration_unusable_period_is_refused(period: float):
    """The period must be a positive, finite time."""
    with pytest.raises(InvalidInput, match=f"period is {period}, expected a number from 1e-09"):
        demonstration(LINE, period, PLANE)


def test_demonstration_quaternion_norm_is_checked(make):
    """Within a thousandth the norm is accepted; beyond, the message gives norm, row and fix."""
    x = make.x(pose_layout(), 6)
    x[4, 3:] *= 1.0009
    np.testing.assert_array_equal(demonstration(x, 0.1, pose_layout()).x, x)
    x[4, 3:] *= 1.0009
    with pytest.raises(InvalidInput, match=r"orientation: row 4 .*norm 1\.0018.*1 such rows.*normalise"):
        demonstration(x, 0.1, pose_layout())
    x[4, 3:] = 0.0
    with pytest.raises(InvalidInput, match="norm 0, expected 1"):
        demonstration(x, 0.1, pose_layout())


def test_demonstration_sign_change_is_refused_and_unwrap_fixes_it(make):
    """The message gives the row, and its fix works, derivatives included."""
    layout = pose_layout().differentiate()
    smooth = make.x(layout, 8)
    flipped = smooth.copy()
    flipped[3:6, 3:7] *= -1
    flipped[3:6, 10:14] *= -1
    with pytest.raises(
        InvalidInput, match=r"changes sign at row 3 .*2 times.*unwrap_orientations\(x, layout\)"
    ):
        demonstration(flipped, 0.1, layout)
    unwrapped = demonstration(unwrap_orientations(flipped, layout), 0.1, layout)
    np.testing.assert_array_equal(unwrapped.x, smooth)


def test_unwrap_orientations_other_width_is_refused():
    """The array must have the columns of the layout."""
    with pytest.raises(InvalidInput, match=r"shape \(4, 2\), expected \(T, 7\)"):
        unwrap_orientations(LINE, pose_layout())


BAD_SETS = [
    ([world_frame(3)], "frame 'world' has 3 columns, expected 2"),
    ([frame("cup", np.eye(2), [0, 0]), frame("cup", np.eye(2), [1, 0])], "two frames named 'cup'"),
    (
        [MovingFrame("belt", np.tile(np.eye(2), (3, 1, 1)), np.zeros((3, 2)))],
        "'belt' has 3 steps, expected 4",
    ),
    ([Frame("flat", np.zeros((2, 2)), np.zeros(2))], "'flat': A is singular"),
]


@pytest.mark.parametrize(("frames", "message"), BAD_SETS, ids=range(len(BAD_SETS)))
def test_demonstration_unusable_frames_are_refused(frames: list[Frame], message: str):
    """Width, length, names and invertibility are checked; the message names recording and frame."""
    with pytest.raises(InvalidInput, match=f"demonstration 'reach'.*{message}"):
        demonstration(LINE, 0.1, PLANE, frames, "reach")


def test_unwrap_orientations_point_of_sphere_keeps_angular_velocity(make):
    """The sign of an orientation on S^3 is unwrapped; its angular velocity does not depend on the sign."""
    layout = Layout((Part("tool", Quantity.ORIENTATION, 4, "1"),)).differentiate()
    smooth = np.hstack([make.quaternions(8), make.rng.normal(size=(8, 3))])
    flipped = smooth.copy()
    flipped[3:6, :4] *= -1
    np.testing.assert_array_equal(unwrap_orientations(flipped, layout), smooth)
