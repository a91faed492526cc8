"""Regression on R^n x S^3 against finite differences, its flat counterpart, and turned worlds."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    conditionals,
    regress_shared,
    riemannian_conditionals,
    riemannian_log_input_densities,
    riemannian_regress_shared,
)
from pilotfish.geometry import differential, exp_at, log_at, multiply, normalise

TURNS = (1, 6)  # a number, a hand's orientation, a number, another orientation
WIDTH, TANGENT = 10, 8
HAND, REST = np.arange(5), np.arange(5, 10)


def components(rng, K, apart=0.6, spread=0.4):
    base = rng.normal(size=WIDTH)
    for start in TURNS:
        base[start : start + 4] = normalise(base[start : start + 4])
    A = rng.normal(size=(K, TANGENT, TANGENT))
    covariances = spread**2 * (A @ A.transpose(0, 2, 1) / TANGENT + 0.1 * np.eye(TANGENT))
    return exp_at(base, apart * rng.normal(size=(K, TANGENT)), TURNS), covariances


def shares_of(given, x):
    log_p = riemannian_log_input_densities(given, x)
    p = np.exp(log_p - log_p.max(axis=1, keepdims=True))
    return p / p.sum(axis=1, keepdims=True)


def told(given, x):
    return riemannian_regress_shared(given, x, shares_of(given, x))


def inputs_near(rng, given, count):
    J = given.flat.slopes.shape[2]
    return exp_at(given.centres[0], 0.3 * rng.normal(size=(count, J)), given.input_turns)


@pytest.mark.parametrize("inputs", [HAND, REST, np.array([0, 5])], ids=["hand", "rest", "numbers"])
@pytest.mark.parametrize("K", [1, 3])
def test_the_jacobian_is_the_derivative_in_the_tangent_spaces(rng, inputs, K):
    """Central differences along deviations of the input, read off as deviations of the mean."""
    given = riemannian_conditionals(*components(rng, K), inputs, TURNS)
    x, step = inputs_near(rng, given, 4), 1e-5
    answer = told(given, x)
    for j, e in enumerate(np.eye(given.flat.slopes.shape[2])):
        after, before = (told(given, exp_at(x, h * e, given.input_turns)).means for h in (step, -step))
        numeric = (log_at(answer.means, after, answer.turns) - log_at(answer.means, before, answer.turns)) / (
            2 * step
        )
        np.testing.assert_allclose(answer.jacobians[:, :, j], numeric, atol=1e-7)


def test_what_components_say_cancels_at_the_mean(rng):
    given = riemannian_conditionals(*components(rng, 3), HAND, TURNS)
    x = inputs_near(rng, given, 6)
    answer, h = told(given, x), shares_of(given, x)
    v = log_at(given.centres[None], x[:, None], given.input_turns)
    guesses = exp_at(given.means[None], np.einsum("kqj,nkj->nkq", given.flat.slopes, v), answer.turns)
    w = log_at(answer.means[:, None], guesses, answer.turns)
    np.testing.assert_allclose(np.einsum("nk,nkq->nq", h, w), 0.0, atol=1e-9)


def test_the_covariance_is_that_of_draws(rng):
    """Of narrow components: draw one by its share, a deviation of its own, and see how the points spread."""
    means, covariances = components(rng, 2, apart=0.3, spread=0.02)
    given = riemannian_conditionals(means, covariances, HAND, TURNS)
    x, shares = inputs_near(rng, given, 1), np.array([[0.3, 0.7]])
    answer, points = riemannian_regress_shared(given, x, shares), []
    for k, count in ((0, 12000), (1, 28000)):
        u = given.flat.slopes[k] @ log_at(given.centres[k], x[0], given.input_turns)
        draws = rng.multivariate_normal(u, given.flat.covariances[k], size=count)
        points.append(exp_at(given.means[k], draws, answer.turns))
    v = log_at(answer.means[0], np.vstack(points), answer.turns)
    expected = v.T @ v / len(v)
    np.testing.assert_allclose(answer.covariances[0], expected, atol=0.03 * np.abs(expected).max())


def test_one_components_covariance_is_carried_by_the_differential(rng):
    given = riemannian_conditionals(*components(rng, 1), HAND, TURNS)
    x = inputs_near(rng, given, 1)
    u = given.flat.slopes[0] @ log_at(given.centres[0], x[0], given.input_turns)
    J = differential(u, given.output_turns)
    np.testing.assert_allclose(told(given, x).covariances[0], J @ given.flat.covariances[0] @ J.T, atol=1e-12)


def test_near_together_regression_is_that_of_flat_space(rng):
    """Within a thousandth of a radian, all that comes out is that of rotation vectors about one base."""
    size = 1e-3
    means, covariances = components(rng, 3, apart=size, spread=size)
    base = means[0]
    flat = conditionals(log_at(base, means, TURNS), covariances, np.arange(4))
    given = riemannian_conditionals(means, covariances, HAND, TURNS)
    v = size * rng.normal(size=(5, 4))
    shares = rng.dirichlet(np.ones(3), size=5)
    expected = regress_shared(flat, v, shares)
    answer = riemannian_regress_shared(given, exp_at(base[HAND], v, (1,)), shares)
    np.testing.assert_allclose(log_at(base[REST], answer.means, (1,)), expected.means, atol=100 * size**2)
    np.testing.assert_allclose(answer.covariances, expected.covariances, atol=100 * size**3)
    np.testing.assert_allclose(answer.jacobians, expected.jacobians, atol=100 * size)


def test_answers_turn_along_with_the_world_whatever_the_signs(rng):
    means, covariances = components(rng, 3)
    world = normalise(rng.normal(size=4))

    def turned(x, starts):
        x = x.copy()
        for s in starts:
            x[..., s : s + 4] = multiply(world, x[..., s : s + 4]) * rng.choice([-1.0, 1.0], size=(len(x), 1))
        return x

    given = riemannian_conditionals(means, covariances, HAND, TURNS)
    there = riemannian_conditionals(turned(means, TURNS), covariances, HAND, TURNS)
    x = inputs_near(rng, given, 5)
    one, other = told(given, x), told(there, turned(x, (1,)))
    np.testing.assert_allclose(log_at(turned(one.means, (1,)), other.means, (1,)), 0.0, atol=1e-10)
    np.testing.assert_allclose(other.covariances, one.covariances, atol=1e-10)
    np.testing.assert_allclose(other.jacobians, one.jacobians, atol=1e-9)


def test_an_orientation_is_given_whole_or_not_at_all(rng):
    means, covariances = components(rng, 2)
    for torn in ([1, 2, 3], [2, 1, 3, 4], [0, 9], list(range(9))):
        with pytest.raises(InvalidInput, match=r"orientation in columns (1|6)"):
            riemannian_conditionals(means, covariances, np.array(torn), TURNS)
    with pytest.raises(InvalidInput, match="leave nothing to map"):
        riemannian_conditionals(means, covariances, np.arange(10), TURNS)
    given = riemannian_conditionals(means, covariances, HAND, TURNS)
    with pytest.raises(InvalidInput, match="expected 5"):
        riemannian_log_input_densities(given, np.zeros((2, 4)))
