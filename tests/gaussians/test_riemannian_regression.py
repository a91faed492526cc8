"""Regression on R^n x S^3 against finite differences, flat regression, and rotated world frames."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import conditional_gaussians, regress_with_responsibilities
from pilotfish.geometry import exp_map, exp_map_jacobian, log_map, multiply, normalise

ORIENTATION_STARTS = (1, 6)  # a number, a hand's orientation, a number, another orientation
WIDTH, TANGENT = 10, 8
HAND, REST = np.arange(5), np.arange(5, 10)


def components(rng, K, apart=0.6, spread=0.4):
    base = rng.normal(size=WIDTH)
    for start in ORIENTATION_STARTS:
        base[start : start + 4] = normalise(base[start : start + 4])
    A = rng.normal(size=(K, TANGENT, TANGENT))
    covariances = spread**2 * (A @ A.transpose(0, 2, 1) / TANGENT + 0.1 * np.eye(TANGENT))
    return exp_map(base, apart * rng.normal(size=(K, TANGENT)), ORIENTATION_STARTS), covariances


def responsibilities_of(conditionals, x):
    log_p = conditionals.log_input_densities(x)
    p = np.exp(log_p - log_p.max(axis=1, keepdims=True))
    return p / p.sum(axis=1, keepdims=True)


def regression(conditionals, x):
    return regress_with_responsibilities(conditionals, x, responsibilities_of(conditionals, x))


def inputs_near(rng, conditionals, count):
    J = conditionals.slopes.shape[2]
    return exp_map(
        conditionals.input_means[0], 0.3 * rng.normal(size=(count, J)), conditionals.input_orientation_starts
    )


@pytest.mark.parametrize("inputs", [HAND, REST, np.array([0, 5])], ids=["hand", "rest", "numbers"])
@pytest.mark.parametrize("K", [1, 3])
def test_regress_jacobian_equals_finite_differences_in_tangent_spaces(rng, inputs, K):
    """Central differences along deviations of the input."""
    conditionals = conditional_gaussians(*components(rng, K), inputs, ORIENTATION_STARTS)
    x, step = inputs_near(rng, conditionals, 4), 1e-5
    answer = regression(conditionals, x)
    for j, e in enumerate(np.eye(conditionals.slopes.shape[2])):
        after, before = (
            regression(conditionals, exp_map(x, h * e, conditionals.input_orientation_starts)).means
            for h in (step, -step)
        )
        numeric = (
            log_map(answer.means, after, answer.orientation_starts)
            - log_map(answer.means, before, answer.orientation_starts)
        ) / (2 * step)
        np.testing.assert_allclose(answer.jacobians[:, :, j], numeric, atol=1e-7)


def test_regress_weighted_predictions_cancel_at_mean(rng):
    conditionals = conditional_gaussians(*components(rng, 3), HAND, ORIENTATION_STARTS)
    x = inputs_near(rng, conditionals, 6)
    answer, h = regression(conditionals, x), responsibilities_of(conditionals, x)
    v = log_map(conditionals.input_means[None], x[:, None], conditionals.input_orientation_starts)
    predictions = exp_map(
        conditionals.means[None],
        np.einsum("kqj,nkj->nkq", conditionals.slopes, v),
        answer.orientation_starts,
    )
    w = log_map(answer.means[:, None], predictions, answer.orientation_starts)
    np.testing.assert_allclose(np.einsum("nk,nkq->nq", h, w), 0.0, atol=1e-9)


def test_regress_covariance_equals_that_of_samples(rng):
    """Narrow components: sample a component by its responsibility, then a deviation."""
    means, covariances = components(rng, 2, apart=0.3, spread=0.02)
    conditionals = conditional_gaussians(means, covariances, HAND, ORIENTATION_STARTS)
    x, responsibilities = inputs_near(rng, conditionals, 1), np.array([[0.3, 0.7]])
    answer, points = regress_with_responsibilities(conditionals, x, responsibilities), []
    for k, count in ((0, 12000), (1, 28000)):
        u = conditionals.slopes[k] @ log_map(
            conditionals.input_means[k], x[0], conditionals.input_orientation_starts
        )
        draws = rng.multivariate_normal(u, conditionals.covariances[k], size=count)
        points.append(exp_map(conditionals.means[k], draws, answer.orientation_starts))
    v = log_map(answer.means[0], np.vstack(points), answer.orientation_starts)
    expected = v.T @ v / len(v)
    np.testing.assert_allclose(answer.covariances[0], expected, atol=0.03 * np.abs(expected).max())


def test_regress_one_component_covariance_is_moved_by_differential(rng):
    conditionals = conditional_gaussians(*components(rng, 1), HAND, ORIENTATION_STARTS)
    x = inputs_near(rng, conditionals, 1)
    u = conditionals.slopes[0] @ log_map(
        conditionals.input_means[0], x[0], conditionals.input_orientation_starts
    )
    J = exp_map_jacobian(u, conditionals.output_orientation_starts)
    np.testing.assert_allclose(
        regression(conditionals, x).covariances[0], J @ conditionals.covariances[0] @ J.T, atol=1e-12
    )


def test_regress_close_means_equals_flat_regression(rng):
    """Within 1e-3 rad, results equal those of rotation vectors about one base."""
    size = 1e-3
    means, covariances = components(rng, 3, apart=size, spread=size)
    base = means[0]
    tangent = conditional_gaussians(log_map(base, means, ORIENTATION_STARTS), covariances, np.arange(4))
    conditionals = conditional_gaussians(means, covariances, HAND, ORIENTATION_STARTS)
    v = size * rng.normal(size=(5, 4))
    responsibilities = rng.dirichlet(np.ones(3), size=5)
    expected = regress_with_responsibilities(tangent, v, responsibilities)
    answer = regress_with_responsibilities(conditionals, exp_map(base[HAND], v, (1,)), responsibilities)
    np.testing.assert_allclose(log_map(base[REST], answer.means, (1,)), expected.means, atol=100 * size**2)
    np.testing.assert_allclose(answer.covariances, expected.covariances, atol=100 * size**3)
    np.testing.assert_allclose(answer.jacobians, expected.jacobians, atol=100 * size)


def test_regress_rotated_world_and_flipped_signs_is_equivalent(rng):
    means, covariances = components(rng, 3)
    world = normalise(rng.normal(size=4))

    def turned(x, starts):
        x = x.copy()
        for s in starts:
            x[..., s : s + 4] = multiply(world, x[..., s : s + 4]) * rng.choice([-1.0, 1.0], size=(len(x), 1))
        return x

    conditionals = conditional_gaussians(means, covariances, HAND, ORIENTATION_STARTS)
    there = conditional_gaussians(turned(means, ORIENTATION_STARTS), covariances, HAND, ORIENTATION_STARTS)
    x = inputs_near(rng, conditionals, 5)
    one, other = regression(conditionals, x), regression(there, turned(x, (1,)))
    np.testing.assert_allclose(log_map(turned(one.means, (1,)), other.means, (1,)), 0.0, atol=1e-10)
    np.testing.assert_allclose(other.covariances, one.covariances, atol=1e-10)
    np.testing.assert_allclose(other.jacobians, one.jacobians, atol=1e-9)


def test_conditional_gaussians_part_of_orientation_raises(rng):
    means, covariances = components(rng, 2)
    for torn in ([1, 2, 3], [2, 1, 3, 4], [0, 9], list(range(9))):
        with pytest.raises(InvalidInput, match=r"orientation in columns (1|6)"):
            conditional_gaussians(means, covariances, np.array(torn), ORIENTATION_STARTS)
    with pytest.raises(InvalidInput, match="at least one input and one output"):
        conditional_gaussians(means, covariances, np.arange(10), ORIENTATION_STARTS)
    conditionals = conditional_gaussians(means, covariances, HAND, ORIENTATION_STARTS)
    with pytest.raises(InvalidInput, match="expected 5"):
        conditionals.log_input_densities(np.zeros((2, 4)))
