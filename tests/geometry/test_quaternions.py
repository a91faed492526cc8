"""Quaternion algebra against matrices, and S^3 against its tangent space."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    angle,
    conjugate,
    left_multiplication_matrix,
    multiply,
    normalise,
    quaternion_exp,
    quaternion_from_rotation_matrix,
    quaternion_log,
    rotation_matrix,
    unwrap_quaternions,
)

EXACT = 1e-14  # a few roundings of numbers of size one
SHAPES = [(), (1,), (5,), (2, 3)]


def units(rng: np.random.Generator, *batch: int) -> np.ndarray:
    return normalise(rng.normal(size=(*batch, 4)))


@pytest.mark.parametrize("batch", SHAPES)
def test_product_of_quaternions_is_product_of_rotation_matrices(
    rng: np.random.Generator, batch: tuple[int, ...]
):
    """R(p q) = R(p) R(q)."""
    p, q = units(rng, *batch), units(rng, *batch)
    expected = rotation_matrix(p) @ rotation_matrix(q)
    np.testing.assert_allclose(rotation_matrix(multiply(p, q)), expected, atol=EXACT)


def test_products_of_the_units_are_hamiltons():
    """I j = k, j k = i, k i = j, i i = -1."""
    one, i, j, k = np.eye(4)
    for p, q, r in [(i, j, k), (j, k, i), (k, i, j), (j, i, -k), (i, i, -one), (one, k, k)]:
        np.testing.assert_array_equal(multiply(p, q), r)


def test_one_quaternion_multiplies_many(rng: np.random.Generator):
    """A batch of one is broadcast."""
    p, q = units(rng), units(rng, 6)
    np.testing.assert_array_equal(multiply(p, q), np.stack([multiply(p, each) for each in q]))
    np.testing.assert_array_equal(angle(p, q), np.stack([angle(p, each) for each in q]))


def test_rotation_matrix_turns_a_vector_as_the_quaternion_does(rng: np.random.Generator):
    """R v is the vector of q (0, v) q*."""
    q, v = units(rng), rng.normal(size=3)
    turned = multiply(multiply(q, np.array([0.0, *v])), conjugate(q))
    np.testing.assert_allclose(turned, [0.0, *(rotation_matrix(q) @ v)], atol=EXACT)


def test_a_quarter_turn_about_z_takes_x_to_y():
    """The sense of rotation is right-handed."""
    q = quaternion_exp(np.array([0.0, 0.0, np.pi / 4]))
    np.testing.assert_allclose(rotation_matrix(q) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=EXACT)


@pytest.mark.parametrize("batch", SHAPES)
def test_left_matrix_multiplies_from_the_left(rng: np.random.Generator, batch: tuple[int, ...]):
    """E(q) p = q p, and E of a unit is a rotation of R^4."""
    p, q = units(rng, *batch), units(rng, *batch)
    E = left_multiplication_matrix(q)
    np.testing.assert_allclose((E @ p[..., None])[..., 0], multiply(q, p), atol=EXACT)
    np.testing.assert_allclose(np.swapaxes(E, -1, -2) @ E, np.broadcast_to(np.eye(4), E.shape), atol=EXACT)


def test_conjugate_turns_back(rng: np.random.Generator):
    """Q q* = |q|^2."""
    q = rng.normal(size=(7, 4))
    expected = np.zeros((7, 4))
    expected[:, 0] = (q**2).sum(axis=1)
    np.testing.assert_allclose(multiply(q, conjugate(q)), expected, atol=1e-13)


@pytest.mark.parametrize("batch", SHAPES)
def test_a_rotation_matrix_gives_its_quaternion_back(rng: np.random.Generator, batch: tuple[int, ...]):
    """from_rotation_matrix inverts rotation_matrix, with w >= 0."""
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
def test_no_branch_of_the_inversion_divides_by_little(q: np.ndarray):
    """Whichever of w x y z is zero or nearly so, the quaternion comes back to full precision."""
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
def test_what_is_no_rotation_is_refused(R: np.ndarray):
    """A mirror image has no quaternion, nor has a scaled axis."""
    with pytest.raises(InvalidInput, match=r"no rotation matrix|nan, expected a finite number"):
        quaternion_from_rotation_matrix(R)


DIRECTION = np.array([0.48, -0.6, 0.64])
LENGTHS = [0.0, 5e-324, 1e-300, 1e-160, 1e-20, 1e-9, 1e-4, 0.3, np.pi / 2, 3.0, np.pi - 1e-6, np.pi - 1e-12]


@pytest.mark.parametrize("length", LENGTHS)
def test_log_undoes_exp(length: float):
    """log(exp(v)) = v from the smallest angle up to almost half way round S^3."""
    v = length * DIRECTION
    q = quaternion_exp(v)
    np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=EXACT)
    np.testing.assert_allclose(quaternion_log(q), v, atol=2e-15, rtol=0)


@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.01))
def test_exp_undoes_log(q: tuple[float, ...]):
    """exp(log(q)) = q on all of S^3, both of q and -q."""
    unit = normalise(np.array(q))
    np.testing.assert_allclose(quaternion_exp(quaternion_log(unit)), unit, atol=4e-15)
    assert np.linalg.norm(quaternion_log(unit)) <= np.pi * (1 + 1e-15)


def test_the_far_pole_has_a_logarithm():
    """exp(log(-1)) = -1, though any direction would do."""
    pole = np.array([-1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(quaternion_log(pole), [np.pi, 0.0, 0.0])
    np.testing.assert_allclose(quaternion_exp(quaternion_log(pole)), pole, atol=EXACT)


@pytest.mark.parametrize("turn", [0.0, 1e-12, 1e-3, 1.0, np.pi - 1e-9, np.pi])
def test_angle_is_how_far_to_turn_whatever_the_signs(rng: np.random.Generator, turn: float):
    """angle(p, p exp(half the turn)) = turn, to full precision for tiny turns and for half turns."""
    p = units(rng)
    q = multiply(p, quaternion_exp(turn / 2 * DIRECTION))
    for a, b in [(p, q), (-p, q), (p, -q), (q, p)]:
        np.testing.assert_allclose(angle(a, b), turn, atol=4e-15)


def test_continuous_removes_every_flip_and_nothing_else(rng: np.random.Generator):
    """Random sign flips of a smooth curve are undone, up to the sign of its first point."""
    smooth = quaternion_exp(np.linspace(0, 3, 40)[:, None] * DIRECTION)
    flipped = smooth * rng.choice([-1.0, 1.0], size=(40, 1))
    np.testing.assert_array_equal(unwrap_quaternions(flipped), smooth * (flipped[0] @ smooth[0]).round())


def test_continuous_leaves_one_point_alone():
    """A curve of one point has nothing to flip."""
    q = np.array([[0.0, 0.0, -1.0, 0.0]])
    np.testing.assert_array_equal(unwrap_quaternions(q), q)


@pytest.mark.parametrize("bad", [[0.0] * 4, [np.nan, 0, 0, 1.0], [np.inf, 0, 0, 0]])
def test_what_has_no_direction_is_not_normalised(bad: list[float]):
    """A zero or endless quaternion is refused, and its place in the batch named."""
    with pytest.raises(InvalidInput, match=r"\(1,\) has norm 0|q\[1, .\] is (nan|inf)"):
        normalise(np.array([[1.0, 0, 0, 0], bad]))
