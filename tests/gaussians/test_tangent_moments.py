"""Statistics on R^n x S^3: exact sums, Karcher means, and scatters that follow the mean."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import TangentMoments, moments, tangent_moments
from pilotfish.geometry import exp_at, log_at, normalise

TURNS = (3,)


def points(rng, count, spread=0.5):
    base = np.concatenate([rng.normal(size=3), normalise(rng.normal(size=4))])
    return exp_at(base, spread * rng.normal(size=(count, 6)), TURNS)


def about(origins, x, shares):
    v = np.stack([log_at(origin, x, TURNS) for origin in origins], axis=1)  # (N, K, E)
    return TangentMoments(
        shares.sum(axis=0),
        origins,
        np.einsum("nk,nke->ke", shares, v),
        np.einsum("nk,nke,nkf->kef", shares, v, v),
        TURNS,
    )


def test_moments_of_halves_add_up_to_moments_of_the_whole(rng):
    x, shares, origins = points(rng, 30), rng.dirichlet(np.ones(2), size=30), points(rng, 2)
    whole = about(origins, x, shares)
    for cut in (1, 14, 29):
        parts = about(origins, x[:cut], shares[:cut]) + about(origins, x[cut:], shares[cut:])
        for name in ("mass", "origins", "offsets", "squares", "means", "scatters"):
            np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), atol=1e-12)


def test_sums_about_different_origins_are_not_added(rng):
    x, shares = points(rng, 9), np.ones((9, 1))
    with pytest.raises(InvalidInput, match="different origins"):
        about(points(rng, 1), x, shares) + about(points(rng, 1), x, shares)


def test_moments_of_points_have_the_karcher_mean(rng):
    """Tangent vectors to it cancel; the scatter is theirs."""
    x, shares = points(rng, 40), rng.dirichlet(np.ones(3), size=40)
    sums = tangent_moments(x, shares, TURNS)
    for k in range(3):
        v = log_at(sums.means[k], x, TURNS)
        np.testing.assert_allclose(shares[:, k] @ v, 0.0, atol=1e-10)
        np.testing.assert_allclose(sums.scatters[k], (shares[:, k, None] * v).T @ v, atol=1e-9)


def test_means_reach_the_karcher_mean_step_by_step(rng):
    """Taking the sums about the mean again and again ends where the sum of tangent vectors vanishes."""
    x, shares = points(rng, 40), rng.dirichlet(np.ones(2), size=40)
    origins = points(rng, 2, spread=0.3)
    origins[:, 3:] = x[:2, 3:]
    for _ in range(60):
        origins = about(origins, x, shares).means
    np.testing.assert_allclose(
        log_at(tangent_moments(x, shares, TURNS).means, origins, TURNS), 0.0, atol=1e-9
    )


def test_off_the_orientations_they_are_ordinary_moments(rng):
    x, shares = points(rng, 20), rng.dirichlet(np.ones(2), size=20)
    sums, flat = about(points(rng, 2), x, shares), moments(x[:, :3], shares)
    np.testing.assert_allclose(sums.means[:, :3], flat.means, atol=1e-12)
    np.testing.assert_allclose(sums.scatters[:, :3, :3], flat.scatters, atol=1e-11)


def test_scatters_are_right_to_first_order_in_the_step_of_the_mean(rng):
    """Halving spread and step divides the error by sixteen: what is left has four small factors."""
    directions, step = rng.normal(size=(30, 6)), rng.normal(size=6)
    base, errors = points(rng, 1)[0], []
    for size in (0.2, 0.1):
        x = exp_at(base, size * directions, TURNS)
        sums = about(exp_at(base, size * step, TURNS)[None], x, np.ones((30, 1)))
        v = log_at(sums.means[0], x, TURNS)
        errors.append(np.abs(sums.scatters[0] - v.T @ v).max())
    assert errors[1] < errors[0] / 12


def test_kept_components_keep_their_moments(rng):
    x, shares = points(rng, 20), rng.dirichlet(np.ones(3), size=20)
    for sums in (tangent_moments(x, shares, TURNS), moments(x, shares)):
        kept = sums[np.array([True, False, True])]
        np.testing.assert_array_equal(kept.means, sums.means[[0, 2]])
        np.testing.assert_array_equal(kept.scatters, sums.scatters[[0, 2]])


def test_an_empty_component_is_no_nan(rng):
    sums = tangent_moments(points(rng, 5), np.tile([1.0, 0.0], (5, 1)), TURNS)
    assert np.isfinite(sums.means).all()
    np.testing.assert_array_equal(sums.scatters[1], 0.0)
