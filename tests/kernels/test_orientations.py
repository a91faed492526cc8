"""Unit quaternions as points of S^3: rotation vectors, their densities and their moments."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pilotfish.kernels import Emissions, SemiMarkovTables, reference
from pilotfish.kernels.reference.manifold import deviations, rotation_vectors


def unit(q):
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


@pytest.fixture
def turning(rng, case):
    """Return a case whose quaternions are near its means, some of them at the antipodes."""

    def draw(P, lengths, D, K, orientation_starts):
        given = case(P, lengths, D, K)
        for start in orientation_starts:
            columns = slice(start, start + 4)
            given.means[..., columns] = unit(given.means[..., columns])
            given.x[..., columns] = unit(given.x[..., columns])
        E = D - len(orientation_starts)
        return given, Emissions(given.means, given.precision_cholesky[..., :E, :E], orientation_starts)

    return draw


def test_rotation_vectors_equal_scipy(rng):
    """In body axes; SciPy orders x y z w."""
    mean, q = unit(rng.normal(size=4)), unit(rng.normal(size=(50, 4)))
    between = Rotation.from_quat(mean[[1, 2, 3, 0]]).inv() * Rotation.from_quat(q[:, [1, 2, 3, 0]])
    np.testing.assert_allclose(rotation_vectors(mean, q), between.as_rotvec(), rtol=1e-9, atol=1e-12)


def columns_about(mean, angles, axis):
    """Return quaternions rotated from the mean by these angles, (N, 4)."""
    half = 0.5 * np.asarray(angles)[:, None]
    turn = np.concatenate([np.cos(half), np.sin(half) * axis], axis=1)
    w, x, y, z = mean
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return turn @ left.T


ANGLES = np.concatenate(
    [
        [0.0],
        np.geomspace(1e-300, 1e-3, 40),
        np.linspace(0.01, np.pi, 400)[:-1],
        np.pi - np.geomspace(1e-7, 1e-2, 20),
    ]
)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_e_step_single_step_offsets_equal_rotation_vectors(kernels, rng, sign):
    """Rotations from zero over tiny ones to almost pi; q and -q are one orientation.

    The offsets of a state over one step are the deviation at this step.
    """
    mean, axis = unit(rng.normal(size=4)), unit(rng.normal(size=3))
    q = sign * columns_about(mean, ANGLES, axis)
    emissions = Emissions(mean[None, None], np.eye(3)[None, None], (0,))
    one = np.ones(1)
    found = [
        kernels.e_step(step[None, None], np.array([1]), one, one[None], emissions).deviation_sums[0, 0]
        for step in q
    ]
    np.testing.assert_allclose(found, ANGLES[:, None] * axis, rtol=1e-7, atol=2e-15)


@pytest.mark.parametrize(
    ("P", "lengths", "D", "K", "orientation_starts"),
    [
        (1, [1], 4, 1, (0,)),
        (2, [40, 9], 7, 3, (3,)),
        (1, [33], 7, 2, (0,)),
        (2, [70], 14, 3, (3, 10)),
        (1, [64, 31], 8, 4, (0, 4)),
        (1, [50], 9, 3, (5, 0)),
        (3, [300], 17, 9, (2, 6, 13)),
    ],
)
def test_e_step_orientations_compiled_equals_reference(
    compiled, turning, P, lengths, D, K, orientation_starts
):
    """Orientations at any columns, in any order, with partial and full blocks."""
    given, emissions = turning(P, lengths, D, K, orientation_starts)
    np.testing.assert_allclose(
        compiled.log_emissions(given.x, emissions), reference.log_emissions(given.x, emissions), rtol=1e-11
    )
    tables = SemiMarkovTables(
        given.initial, given.transitions * (1.0 - np.eye(K)), np.zeros((4, 20, K)), np.zeros((2, K))
    )
    markov = given.x, given.lengths, given.initial, given.transitions, emissions
    for name, arguments in [("e_step", markov), ("semi_markov_e_step", (*markov[:2], tables, emissions))]:
        result, reference_result = getattr(compiled, name)(*arguments), getattr(reference, name)(*arguments)
        for sums in type(reference_result)._fields:
            found, expected = getattr(result, sums), getattr(reference_result, sums)
            scale = np.abs(expected).max(initial=0.0)
            np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-11 * scale, err_msg=sums)


def test_e_step_flipped_quaternions_are_equal(kernels, turning, rng):
    """Signs of data and of means."""
    given, emissions = turning(2, [40, 9], 7, 3, (3,))
    flipped, means = given.x.copy(), emissions.means.copy()
    flipped[..., 3:] *= rng.choice([-1.0, 1.0], size=(2, 49, 1))
    means[..., 3:] *= rng.choice([-1.0, 1.0], size=(2, 3, 1))
    rest = given.lengths, given.initial, given.transitions
    result = kernels.e_step(given.x, *rest, emissions)
    flipped_result = kernels.e_step(
        flipped, *rest, Emissions(means, emissions.precision_cholesky, emissions.orientation_starts)
    )
    for sums in type(result)._fields:
        np.testing.assert_allclose(
            getattr(flipped_result, sums), getattr(result, sums), rtol=1e-9, atol=1e-11
        )


def test_deviations_other_columns_are_shifted(rng):
    """A rotation vector takes three columns in place of four."""
    x, mean = rng.normal(size=(6, 9)), rng.normal(size=9)
    found = deviations(x, mean, (2,))
    np.testing.assert_array_equal(found[:, :2], x[:, :2] - mean[:2])
    np.testing.assert_array_equal(found[:, 5:], x[:, 6:] - mean[6:])
