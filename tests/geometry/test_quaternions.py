"""Quaternion algebra against matrices, and S^3 against its tangent space."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    angle,
    conjugate,
    from_rotation_vector,
    left_multiplication_matrix,
    multiply,
    normalise,
    quaternion_exp,
    quaternion_from_rotation_matrix,
    quaternion_log,
    rotation_matrix,
    to_rotation_vector,
    unwrap_quaternions,
)

EXACT = 1e-14  # a few roundings of numbers of size one
SHAPES = [(), (1,), (5,), (2, 3)]


def units(rng: np.random.Generator, *batch: int) -> np.ndarray:
    return normalise(rng.normal(size=(*batch, 4)))


@pytest.mark.parametrize("batch", SHAPES)
def test_multiply_equals_product_of_rotation_matrices(rng: np.random.Generator, batch: tuple[int, ...]):
    p, q = units(rng, *batch), units(rng, *batch)
    expected = rotation_matrix(p) @ rotation_matrix(q)
    np.testing.assert_allclose(rotation_matrix(multiply(p, q)), expected, atol=EXACT)


def test_multiply_two_quaternions_equals_batch_exactly(rng: np.random.Generator):
    p, q = rng.normal(size=(2, 100, 4)) * 10.0 ** rng.integers(-60, 60, (2, 100, 1))
    assert np.array_equal([multiply(*pair) for pair in zip(p, q, strict=True)], multiply(p, q))


def test_multiply_units_follows_hamilton():
    """The products are i j = k, j k = i, k i = j, i i = -1."""
    one, i, j, k = np.eye(4)
    for p, q, r in [(i, j, k), (j, k, i), (k, i, j), (j, i, -k), (i, i, -one), (one, k, k)]:
        np.testing.assert_array_equal(multiply(p, q), r)


def test_multiply_one_by_many_broadcasts(rng: np.random.Generator):
    p, q = units(rng), units(rng, 6)
    np.testing.assert_array_equal(multiply(p, q), np.stack([multiply(p, each) for each in q]))
    np.testing.assert_array_equal(angle(p, q), np.stack([angle(p, each) for each in q]))


def test_rotation_matrix_times_vector_equals_quaternion_sandwich(rng: np.random.Generator):
    """R v is the vector part of q (0, v) q*."""
    q, v = units(rng), rng.normal(size=3)
    turned = multiply(multiply(q, np.array([0.0, *v])), conjugate(q))
    np.testing.assert_allclose(turned, [0.0, *(rotation_matrix(q) @ v)], atol=EXACT)


def test_rotation_matrix_quarter_turn_about_z_maps_x_to_y():
    """The sense of rotation is right-handed."""
    q = quaternion_exp(np.array([0.0, 0.0, np.pi / 4]))
    np.testing.assert_allclose(rotation_matrix(q) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=EXACT)


@pytest.mark.parametrize("batch", SHAPES)
def test_left_multiplication_matrix_equals_multiply(rng: np.random.Generator, batch: tuple[int, ...]):
    """For a unit quaternion it is a rotation of R^4."""
    p, q = units(rng, *batch), units(rng, *batch)
    E = left_multiplication_matrix(q)
    np.testing.assert_allclose((E @ p[..., None])[..., 0], multiply(q, p), atol=EXACT)
    np.testing.assert_allclose(np.swapaxes(E, -1, -2) @ E, np.broadcast_to(np.eye(4), E.shape), atol=EXACT)


def test_multiply_by_conjugate_is_squared_norm(rng: np.random.Generator):
    q = rng.normal(size=(7, 4))
    expected = np.zeros((7, 4))
    expected[:, 0] = (q**2).sum(axis=1)
    np.testing.assert_allclose(multiply(q, conjugate(q)), expected, atol=1e-13)


@pytest.mark.parametrize("batch", SHAPES)
def test_quaternion_from_rotation_matrix_inverts_rotation_matrix(
    rng: np.random.Generator, batch: tuple[int, ...]
):
    """The result has w >= 0."""
    q = units(rng, *batch)
    back = quaternion_from_rotation_matrix(rotation_matrix(q))
    np.testing.assert_allclose(back, np.where(q[..., :1] < 0, -q, q), atol=1e-13)


HALF_TURNS = [
    *np.eye(4),
    *np.eye(4)[1:] + np.eye(4)[[2, 3, 1]],
    [1e-9, 0.6, 0.0, 0.8],
    [0.01, -1.0, 1e-9, 0.0],
]


@pytest.mark.parametrize("q", HALF_TURNS, ids=str)
def test_quaternion_from_rotation_matrix_small_components_are_exact(q: np.ndarray):
    """Components that are zero or nearly zero are recovered to full precision."""
    unit = normalise(np.asarray(q, dtype=float))
    back = quaternion_from_rotation_matrix(rotation_matrix(unit))
    assert back[0] >= 0
    np.testing.assert_allclose(back * np.sign(back @ unit), unit, atol=1e-15)


@pytest.mark.parametrize(
    "R",
    [
        np.diag([1.0, 1.0, -1.0]),
        1.01 * np.eye(3),
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.eye(3)[[1, 0, 2]],
    ],
    ids=["mirror", "scaled", "zero", "nan", "swapped"],
)
def test_quaternion_from_rotation_matrix_not_a_rotation_raises(R: np.ndarray):
    """Neither a reflection nor a scaled axis has a quaternion."""
    with pytest.raises(InvalidInput, match=r"not a rotation matrix|nan, expected a finite number"):
        quaternion_from_rotation_matrix(R)


DIRECTION = np.array([0.48, -0.6, 0.64])
LENGTHS = [0.0, 5e-324, 1e-300, 1e-160, 1e-20, 1e-9, 1e-4, 0.3, np.pi / 2, 3.0, np.pi - 1e-6, np.pi - 1e-12]


@pytest.mark.parametrize("length", LENGTHS)
def test_quaternion_log_of_exp_returns_vector(length: float):
    """From the smallest angle almost to the antipode on S^3."""
    v = length * DIRECTION
    q = quaternion_exp(v)
    np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=EXACT)
    np.testing.assert_allclose(quaternion_log(q), v, atol=2e-15, rtol=0)


@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.01))
def test_quaternion_exp_of_log_returns_quaternion(q: tuple[float, ...]):
    """On all of S^3, for both q and -q."""
    unit = normalise(np.array(q))
    np.testing.assert_allclose(quaternion_exp(quaternion_log(unit)), unit, atol=4e-15)
    assert np.linalg.norm(quaternion_log(unit)) <= np.pi * (1 + 1e-15)


def test_quaternion_log_at_antipode_is_pi():
    """exp(log(-1)) = -1, although every direction is valid."""
    pole = np.array([-1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(quaternion_log(pole), [np.pi, 0.0, 0.0])
    np.testing.assert_allclose(quaternion_exp(quaternion_log(pole)), pole, atol=EXACT)


@pytest.mark.parametrize("length", LENGTHS)
def test_from_rotation_vector_rotates_by_its_length_and_is_inverted(length: float):
    q = from_rotation_vector(length * DIRECTION)
    np.testing.assert_array_equal(q, quaternion_exp(0.5 * length * DIRECTION))
    np.testing.assert_allclose(angle(np.array([1.0, 0.0, 0.0, 0.0]), q), length, atol=4e-15)
    np.testing.assert_allclose(to_rotation_vector(q), length * DIRECTION, atol=4e-15, rtol=0)


@pytest.mark.parametrize("turn", [0.0, 1e-12, 1e-3, 1.0, np.pi - 1e-9, np.pi])
def test_angle_any_signs_equals_rotation_angle(rng: np.random.Generator, turn: float):
    """Exact for tiny rotations and for half turns."""
    p = units(rng)
    q = multiply(p, quaternion_exp(turn / 2 * DIRECTION))
    for a, b in [(p, q), (-p, q), (p, -q), (q, p)]:
        np.testing.assert_allclose(angle(a, b), turn, atol=4e-15)


def test_unwrap_quaternions_removes_sign_flips(rng: np.random.Generator):
    """Random sign flips of a smooth curve are undone, up to the sign of its first point."""
    smooth = quaternion_exp(np.linspace(0, 3, 40)[:, None] * DIRECTION)
    flipped = smooth * rng.choice([-1.0, 1.0], size=(40, 1))
    np.testing.assert_array_equal(unwrap_quaternions(flipped), smooth * (flipped[0] @ smooth[0]).round())


def test_unwrap_quaternions_one_point_is_unchanged():
    q = np.array([[0.0, 0.0, -1.0, 0.0]])
    np.testing.assert_array_equal(unwrap_quaternions(q), q)


@pytest.mark.parametrize("bad", [[0.0] * 4, [np.nan, 0, 0, 1.0], [np.inf, 0, 0, 0]])
def test_normalise_zero_or_infinite_quaternion_raises_with_index(bad: list[float]):
    with pytest.raises(InvalidInput, match=r"\(1,\) has norm 0|q\[1, .\] is (nan|inf)"):
        normalise(np.array([[1.0, 0, 0, 0], bad]))
