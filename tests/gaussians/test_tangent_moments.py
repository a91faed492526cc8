"""Statistics on R^n x S^3: exact sums, Karcher means, and scatters that follow the mean."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments, TangentMoments
from pilotfish.geometry import exp_map, log_map, normalise

ORIENTATION_STARTS = (3,)


def points(rng, count, spread=0.5):
    base = np.concatenate([rng.normal(size=3), normalise(rng.normal(size=4))])
    return exp_map(base, spread * rng.normal(size=(count, 6)), ORIENTATION_STARTS)


def tangent_sums(origins, x, responsibilities):
    v = np.stack([log_map(origin, x, ORIENTATION_STARTS) for origin in origins], axis=1)  # (N, K, E)
    return TangentMoments(
        responsibilities.sum(axis=0),
        origins,
        np.einsum("nk,nke->ke", responsibilities, v),
        np.einsum("nk,nke,nkf->kef", responsibilities, v, v),
        ORIENTATION_STARTS,
    )


def test_add_moments_of_halves_equals_moments_of_whole(rng):
    x, responsibilities, origins = points(rng, 30), rng.dirichlet(np.ones(2), size=30), points(rng, 2)
    whole = tangent_sums(origins, x, responsibilities)
    for cut in (1, 14, 29):
        parts = tangent_sums(origins, x[:cut], responsibilities[:cut]) + tangent_sums(
            origins, x[cut:], responsibilities[cut:]
        )
        for name in ("counts", "origins", "deviation_sums", "outer_products", "means", "scatter_matrices"):
            np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), atol=1e-12)


def test_add_different_origins_raises(rng):
    x, responsibilities = points(rng, 9), np.ones((9, 1))
    with pytest.raises(InvalidInput, match="different origins"):
        tangent_sums(points(rng, 1), x, responsibilities) + tangent_sums(points(rng, 1), x, responsibilities)


def test_tangent_moments_means_equal_karcher_mean(rng):
    """Tangent vectors to it sum to zero."""
    x, responsibilities = points(rng, 40), rng.dirichlet(np.ones(3), size=40)
    sums = TangentMoments.from_data(x, responsibilities, ORIENTATION_STARTS)
    for k in range(3):
        v = log_map(sums.means[k], x, ORIENTATION_STARTS)
        np.testing.assert_allclose(responsibilities[:, k] @ v, 0.0, atol=1e-10)
        np.testing.assert_allclose(
            sums.scatter_matrices[k], (responsibilities[:, k, None] * v).T @ v, atol=1e-9
        )


def test_means_repeated_converge_to_karcher_mean(rng):
    """Computing the sums about the last mean repeatedly converges."""
    x, responsibilities = points(rng, 40), rng.dirichlet(np.ones(2), size=40)
    origins = points(rng, 2, spread=0.3)
    origins[:, 3:] = x[:2, 3:]
    for _ in range(60):
        origins = tangent_sums(origins, x, responsibilities).means
    np.testing.assert_allclose(
        log_map(
            TangentMoments.from_data(x, responsibilities, ORIENTATION_STARTS).means,
            origins,
            ORIENTATION_STARTS,
        ),
        0.0,
        atol=1e-9,
    )


def test_tangent_moments_without_orientations_equal_moments(rng):
    x, responsibilities = points(rng, 20), rng.dirichlet(np.ones(2), size=20)
    sums, flat = (
        tangent_sums(points(rng, 2), x, responsibilities),
        Moments.from_data(x[:, :3], responsibilities),
    )
    np.testing.assert_allclose(sums.means[:, :3], flat.means, atol=1e-12)
    np.testing.assert_allclose(sums.scatter_matrices[:, :3, :3], flat.scatter_matrices, atol=1e-11)


def test_scatter_matrices_error_is_of_second_order_in_step(rng):
    """Halving deviations and step divides the error by sixteen: it has four small factors."""
    directions, step = rng.normal(size=(30, 6)), rng.normal(size=6)
    base, errors = points(rng, 1)[0], []
    for size in (0.2, 0.1):
        x = exp_map(base, size * directions, ORIENTATION_STARTS)
        sums = tangent_sums(exp_map(base, size * step, ORIENTATION_STARTS)[None], x, np.ones((30, 1)))
        v = log_map(sums.means[0], x, ORIENTATION_STARTS)
        errors.append(np.abs(sums.scatter_matrices[0] - v.T @ v).max())
    assert errors[1] < errors[0] / 12


def test_getitem_mask_keeps_moments(rng):
    x, responsibilities = points(rng, 20), rng.dirichlet(np.ones(3), size=20)
    for sums in (
        TangentMoments.from_data(x, responsibilities, ORIENTATION_STARTS),
        Moments.from_data(x, responsibilities),
    ):
        kept = sums[np.array([True, False, True])]
        np.testing.assert_array_equal(kept.means, sums.means[[0, 2]])
        np.testing.assert_array_equal(kept.scatter_matrices, sums.scatter_matrices[[0, 2]])


def test_tangent_moments_empty_component_is_finite(rng):
    sums = TangentMoments.from_data(points(rng, 5), np.tile([1.0, 0.0], (5, 1)), ORIENTATION_STARTS)
    assert np.isfinite(sums.means).all()
    np.testing.assert_array_equal(sums.scatter_matrices[1], 0.0)
