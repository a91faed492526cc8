"""Gaussians on R^n x S^3 against numeric optimisation, integrals, and their flat counterparts."""

import numpy as np
import pytest
from scipy.optimize import minimize

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    Gaussian,
    RiemannianGaussian,
    log_density,
    product,
)
from pilotfish.geometry import exp_map, log_map, multiply, normalise

ORIENTATION_STARTS = (3,)


def random_gaussian(rng, base, apart=0.5, spread=0.3):
    A = rng.normal(size=(6, 6))
    return RiemannianGaussian(
        exp_map(base, apart * rng.normal(size=6), ORIENTATION_STARTS),
        spread**2 * (A @ A.T + 0.1 * np.eye(6)),
        ORIENTATION_STARTS,
    )


@pytest.fixture
def base(rng):
    return np.concatenate([rng.normal(size=3), normalise(rng.normal(size=4))])


def test_riemannian_log_density_equals_density_of_tangent_vector(rng, base):
    g, v = random_gaussian(rng, base), 0.5 * rng.normal(size=(5, 6))
    expected = log_density(Gaussian(np.zeros(6), g.covariance), v)
    np.testing.assert_allclose(g.log_density(exp_map(g.mean, v, ORIENTATION_STARTS)), expected, atol=1e-9)


def test_tangent_gaussian_matches_value_and_slope(rng, base):
    """At that point, up to the constant."""
    g, step = random_gaussian(rng, base), 1e-5
    point_there = exp_map(base, 0.6 * rng.normal(size=6), ORIENTATION_STARTS)
    tangent, h = g.tangent_gaussian(point_there), step * rng.normal(size=(20, 6))
    flat = log_density(tangent, h) - log_density(tangent, np.zeros((1, 6)))
    true = g.log_density(exp_map(point_there, h, ORIENTATION_STARTS)) - g.log_density(point_there[None])
    np.testing.assert_allclose(flat, true, atol=1e3 * step**2)
    assert np.abs(true).max() > 1e5 * step**2


@pytest.mark.parametrize("count", [2, 3])
def test_riemannian_product_mean_is_mode(rng, base, count):
    """A general optimiser finds no more likely point."""
    said = [random_gaussian(rng, base) for _ in range(count)]
    fused = RiemannianGaussian.product(said)

    def cost(v):
        return -sum(g.log_density(exp_map(fused.mean, v, ORIENTATION_STARTS)[None])[0] for g in said)

    found = minimize(cost, 1e-2 * rng.normal(size=6), method="BFGS", options={"gtol": 1e-8})
    assert found.fun >= cost(np.zeros(6)) - 1e-9
    np.testing.assert_allclose(found.x, 0.0, atol=1e-5)


def test_riemannian_product_covariance_equals_curvature(rng, base):
    """Second differences; the part from the curvature of S^3 vanishes with the standard deviations."""
    said = [random_gaussian(rng, base, apart=0.01, spread=0.01) for _ in range(2)]
    fused, step = RiemannianGaussian.product(said), 1e-4

    def cost(v):
        return -sum(g.log_density(exp_map(fused.mean, v, ORIENTATION_STARTS)[None])[0] for g in said)

    E = step * np.eye(6)
    hessian = np.array([[cost(a + b) - cost(a - b) - cost(b - a) + cost(-a - b) for a in E] for b in E]) / (
        4 * step**2
    )
    np.testing.assert_allclose(fused.covariance @ hessian, np.eye(6), atol=0.02)


def test_riemannian_product_close_means_equals_flat_product(rng, base):
    """Within 1e-3 rad: means to second order, covariances to first."""
    size = 1e-3
    said = [random_gaussian(rng, base, apart=size, spread=size) for _ in range(3)]
    flat = product([Gaussian(log_map(base, g.mean, ORIENTATION_STARTS), g.covariance) for g in said])
    fused = RiemannianGaussian.product(said)
    np.testing.assert_allclose(log_map(base, fused.mean, ORIENTATION_STARTS), flat.mean, atol=20 * size**2)
    np.testing.assert_allclose(fused.covariance, flat.covariance, atol=20 * size**3)


def test_riemannian_product_any_order_and_world_frame_is_equivalent(rng, base):
    said, world = [random_gaussian(rng, base) for _ in range(3)], normalise(rng.normal(size=4))
    fused = RiemannianGaussian.product(said)
    turned = [
        RiemannianGaussian(
            np.concatenate([g.mean[:3], rng.choice([-1.0, 1.0]) * multiply(world, g.mean[3:])]),
            g.covariance,
            ORIENTATION_STARTS,
        )
        for g in said
    ]
    point_there = RiemannianGaussian.product(turned[::-1])
    back = np.concatenate([fused.mean[:3], multiply(world, fused.mean[3:])])
    np.testing.assert_allclose(log_map(point_there.mean, back, ORIENTATION_STARTS), 0.0, atol=1e-8)
    np.testing.assert_allclose(point_there.covariance, fused.covariance, atol=1e-8)


def test_riemannian_product_two_equal_factors_halves_covariance(rng, base):
    g = random_gaussian(rng, base)
    fused = RiemannianGaussian.product([g, g])
    np.testing.assert_allclose(log_map(g.mean, fused.mean, ORIENTATION_STARTS), 0.0, atol=1e-12)
    np.testing.assert_allclose(fused.covariance, 0.5 * g.covariance, atol=1e-12)
    assert RiemannianGaussian.product([g]) is g


def test_riemannian_product_means_half_turn_apart_is_half_way(rng):
    """A quarter turn to either side, with at most the covariance of one factor."""
    q = normalise(rng.normal(size=(1, 4)))[0]
    said = [RiemannianGaussian(m, 0.04 * np.eye(3), (0,)) for m in (q, multiply(q, np.array([0, 1.0, 0, 0])))]
    fused = RiemannianGaussian.product(said)
    for g in said:
        assert np.linalg.norm(log_map(g.mean, fused.mean, (0,))) == pytest.approx(np.pi / 2, abs=1e-6)


def test_riemannian_product_empty_raises():
    with pytest.raises(InvalidInput, match="at least one"):
        RiemannianGaussian.product([])


def test_riemannian_product_conflicting_means_is_no_less_likely_than_either(rng, base):
    """Means many deviations apart turn some products to a half turn from a mean, where the density jumps."""
    for _ in range(30):
        said = [random_gaussian(rng, base, apart=2.0) for _ in range(2)]
        points = np.stack([RiemannianGaussian.product(said).mean, *(g.mean for g in said)])
        fused, *means = sum(g.log_density(points) for g in said)
        assert fused >= max(means)
