"""Poses compose as the matrices that they stand for."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, normalise, pose, rotation_matrix

EXACT = 1e-13


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), normalise(rng.normal(size=4)))


def matrix(pose: Pose) -> np.ndarray:
    """Return the pose as a 4 x 4 homogeneous matrix."""
    homogeneous = np.eye(4)
    homogeneous[:3, :3], homogeneous[:3, 3] = rotation_matrix(pose.quaternion), pose.position
    return homogeneous


def test_pose_product_equals_product_of_homogeneous_matrices(rng: np.random.Generator):
    world_from_a, a_from_b = random_pose(rng), random_pose(rng)
    expected = matrix(world_from_a) @ matrix(a_from_b)
    np.testing.assert_allclose(matrix(world_from_a @ a_from_b), expected, atol=EXACT)


def test_pose_product_is_associative(rng: np.random.Generator):
    a, b, c = (random_pose(rng) for _ in range(3))
    left, right = (a @ b) @ c, a @ (b @ c)
    np.testing.assert_allclose(left.position, right.position, atol=EXACT)
    np.testing.assert_allclose(left.quaternion, right.quaternion, atol=EXACT)


def test_pose_times_inverse_is_identity(rng: np.random.Generator):
    """Both orders."""
    there = random_pose(rng)
    for nothing in (there @ there.inverse(), there.inverse() @ there):
        np.testing.assert_allclose(nothing.position, 0.0, atol=EXACT)
        np.testing.assert_allclose(nothing.quaternion, [1, 0, 0, 0], atol=EXACT)


def test_pose_rounded_quaternion_is_normalised():
    """Four typed digits make a unit quaternion."""
    typed = pose([1, 2, 3], [0.7071, 0.7071, 0, 0])
    np.testing.assert_allclose(np.linalg.norm(typed.quaternion), 1.0, atol=1e-15)
    assert typed.position.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("position", "quaternion", "message"),
    [
        ([0, 0, 0], [1, 1, 0, 0], r"norm 1\.41421, expected 1 .*normalise"),
        ([0, 0, 0], [0, 0, 0, 0], "norm 0"),
        ([0, 0], [1, 0, 0, 0], r"position has shape \(2,\), expected \(3,\)"),
        ([0, 0, 0], [1, 0, 0], r"quaternion has shape \(3,\), expected \(4,\)"),
        ([0, np.nan, 0], [1, 0, 0, 0], r"position\[1\] is nan, expected a finite"),
        ([0, 0, 0], [np.inf, 0, 0, 0], r"quaternion\[0\] is inf, expected a finite"),
        ("here", [1, 0, 0, 0], "position has .* not real numbers.*'here'"),
        ([0, 0, 0], [[1, 0], [0]], "quaternion has rows of different lengths"),
    ],
)
def test_pose_invalid_arguments_raise_with_value_and_fix(position: object, quaternion: object, message: str):
    with pytest.raises(InvalidInput, match=message):
        pose(position, quaternion)
