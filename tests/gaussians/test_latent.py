"""Covariances of few factors: whitened without an inverse, likeliest of their kind, and never worse."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import (
    HDDC,
    MFA,
    MPPCA,
    Diagonal,
    Full,
    LatentCovariances,
    Spherical,
)
from pilotfish.gaussians.structures.latent import principal_components


def samples(rng, K, D, points=None):
    A = rng.normal(size=(K, D, points or D))
    return A @ A.transpose(0, 2, 1) / (points or D) + 0.02 * np.eye(D), rng.uniform(1.0, 50.0, size=K)


def latent(rng, K, D, L, size=1.0, noise=1.0):
    return LatentCovariances(size * rng.normal(size=(K, D, L)), noise * rng.uniform(0.3, 1.0, size=(K, D)))


def auxiliary(counts, S, covariances):
    """Return twice the expected log-likelihood that an M-step maximises (4.18), up to a constant."""
    fit = np.trace(np.linalg.solve(covariances, S), axis1=1, axis2=2)
    return -float(counts @ (np.linalg.slogdet(covariances)[1] + fit))


def white_error(latent_covariances: LatentCovariances) -> float:
    """Return the largest entry of W Sigma W^T - I, in exact arithmetic on the stored numbers."""
    loadings, noise, W = (
        np.vectorize(Fraction, otypes=[object])(a)
        for a in (
            latent_covariances.loadings[0],
            latent_covariances.noise[0],
            latent_covariances.precision_cholesky("the covariance of state")[0],
        )
    )
    error = W @ (loadings @ loadings.T + np.diag(noise)) @ W.T - np.eye(len(W), dtype=int)
    return float(np.abs(error).max())


@pytest.mark.parametrize(("K", "D", "L"), [(1, 1, 0), (1, 1, 1), (3, 5, 2), (2, 4, 0), (2, 4, 6)])
def test_precision_cholesky_equals_inverse_cholesky_factor(rng, K, D, L):
    """W is lower triangular with a positive diagonal, and W^T W is the inverse of the covariance."""
    latent_covariances = latent(rng, K, D, L)
    W = latent_covariances.precision_cholesky("the covariance of state")
    np.testing.assert_array_equal(W, np.tril(W))
    assert np.diagonal(W, axis1=1, axis2=2).min() > 0.0
    np.testing.assert_allclose(
        W.transpose(0, 2, 1) @ W, np.linalg.inv(latent_covariances.dense), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(
    ("size", "noise", "tolerance"), [(1.0, 1.0, 1e-14), (1e3, 1e-2, 1e-9), (1e3, 1e-10, 3e-6)]
)
def test_precision_cholesky_tiny_noise_equals_rational_arithmetic(rng, size, noise, tolerance):
    """Rounding grows with the root of the condition number, against rational arithmetic."""
    assert white_error(latent(rng, 1, 5, 3, size, noise)) < tolerance


def test_precision_cholesky_column_without_noise_is_exact(rng):
    """Two factors determine two columns exactly; the noise of other columns keeps the covariance definite."""
    latent_covariances = latent(rng, 1, 5, 2)
    free = LatentCovariances(
        latent_covariances.loadings, latent_covariances.noise * np.array([0.0, 1.0, 0.0, 1.0, 1.0])
    )
    assert white_error(free) < 1e-12


def test_precision_cholesky_zero_innovation_raises_with_name(rng):
    latent_covariances = latent(rng, 2, 3, 1)
    flat = LatentCovariances(
        latent_covariances.loadings * [[[1.0], [1.0], [0.0]]],
        latent_covariances.noise * np.array([1.0, 1.0, 0.0]),
    )
    with pytest.raises(NotPositiveDefinite, match=r"the covariance of state 0 .* column 2"):
        flat.precision_cholesky("the covariance of state")


def test_factors_padded_loadings_are_not_counted(rng):
    S, _ = samples(rng, 3, 5)
    np.testing.assert_array_equal(principal_components(S, np.array([2, 0, 4])).factors, [2, 0, 4])


@pytest.mark.parametrize("structure", [MFA(0), MFA(2), MFA(5), MPPCA(1), MPPCA(4), HDDC(3)])
def test_estimate_repeated_never_lowers_likelihood(rng, structure):
    S, counts = samples(rng, 4, 6, points=9)
    values, before = [], None
    for _ in range(25):
        before = structure.estimate(counts, S, before)
        values.append(auxiliary(counts, S, before.dense))
    assert np.diff(values).min() >= -1e-11 * abs(values[-1])
    assert values[-1] <= auxiliary(counts, S, Full().estimate(counts, S, None).dense) + 1e-9


@pytest.mark.parametrize("structure", [MFA(2), MFA(3), MPPCA(2), HDDC(2), HDDC(0.8)])
def test_estimate_changing_samples_never_lowers_likelihood(rng, structure):
    """As in expectation-maximisation, where every M-step continues with other samples."""
    counts, before = rng.uniform(1.0, 50.0, size=4), None
    for S in (samples(rng, 4, 6, points=n)[0] for n in (8, 7, 20, 5, 6)):
        after = structure.estimate(counts, S, before)
        if before is not None:
            worse = auxiliary(counts, S, before.dense)
            assert auxiliary(counts, S, after.dense) >= worse - 1e-11 * abs(worse)
        before = after


def test_em_step_factor_analysis_equals_printed_equations(rng):
    """Equations 4.9-4.13 with their D x D inverse."""
    S, counts = samples(rng, 3, 6)
    old = latent(rng, 3, 6, 2)
    new = MFA(2, sweeps=1).estimate(counts, S, old)
    for k in range(3):
        Lam, Psi = old.loadings[k], np.diag(old.noise[k])
        B = Lam.T @ np.linalg.inv(Lam @ Lam.T + Psi)
        loadings = S[k] @ B.T @ np.linalg.inv(np.eye(2) - B @ Lam + B @ S[k] @ B.T)
        np.testing.assert_allclose(new.loadings[k], loadings, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(new.noise[k], np.diag(S[k] - loadings @ B @ S[k]), rtol=1e-9, atol=1e-11)


def test_em_step_principal_components_equals_corrected_equations(rng):
    """Equations 4.14-4.15 with M = Lambda^T Lambda + sigma^2 I in place of Sigma."""
    S, counts = samples(rng, 3, 6)
    old = LatentCovariances(rng.normal(size=(3, 6, 2)), np.tile(rng.uniform(0.2, 1.0, size=(3, 1)), (1, 6)))
    new = MPPCA(2, sweeps=1).estimate(counts, S, old)
    for k in range(3):
        Lam, s2 = old.loadings[k], old.noise[k, 0]
        M = Lam.T @ Lam + s2 * np.eye(2)
        loadings = S[k] @ Lam @ np.linalg.inv(s2 * np.eye(2) + np.linalg.inv(M) @ Lam.T @ S[k] @ Lam)
        noise = np.trace(S[k] - S[k] @ Lam @ np.linalg.inv(M) @ loadings.T) / 6
        np.testing.assert_allclose(new.loadings[k], loadings, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(new.noise[k], noise, rtol=1e-9)


@pytest.mark.parametrize("components", [1, 2, 4])
def test_mppca_iteration_converges_to_closed_form(rng, components):
    """From random loadings: there is no other maximum (Tipping & Bishop 1999)."""
    Q = np.linalg.qr(rng.normal(size=(3, 5, 5)))[0]
    S, counts = (Q * [6.0, 3.0, 1.5, 0.7, 0.3]) @ Q.transpose(0, 2, 1), np.ones(3)
    start = LatentCovariances(rng.normal(size=(3, 5, components)), np.ones((3, 5)))
    reached = MPPCA(components, sweeps=400).estimate(counts, S, start)
    closed = principal_components(S, np.full(3, components))
    np.testing.assert_allclose(
        auxiliary(counts, S, reached.dense), auxiliary(counts, S, closed.dense), rtol=1e-9
    )
    np.testing.assert_allclose(reached.dense, closed.dense, rtol=1e-4, atol=1e-4 * np.abs(S).max())


def test_principal_components_keep_leading_eigenvalues_and_average_others(rng):
    S, _ = samples(rng, 2, 6)
    found, true = (np.linalg.eigvalsh(M) for M in (principal_components(S, np.array([2, 4])).dense, S))
    np.testing.assert_allclose(found[0], [*[true[0, :4].mean()] * 4, *true[0, 4:]])
    np.testing.assert_allclose(found[1], [*[true[1, :2].mean()] * 2, *true[1, 2:]])


def test_principal_components_random_neighbours_are_less_likely(rng):
    """Small random changes of loadings and noise lower the likelihood."""
    S, counts = samples(rng, 2, 5)
    best = principal_components(S, np.array([2, 2]))
    top = auxiliary(counts, S, best.dense)
    for _ in range(20):
        loadings = best.loadings * (1.0 + 0.05 * rng.normal(size=best.loadings.shape))
        noise = best.noise * (1.0 + 0.05 * rng.uniform(-1.0, 1.0, size=(2, 1)))
        assert auxiliary(counts, S, LatentCovariances(loadings, noise).dense) < top


def test_mfa_exact_factor_model_is_recovered(rng):
    """Samples of exactly two factors and unequal noise; small noise converges most slowly."""
    true = latent(rng, 2, 8, 2, size=2.0)
    found = MFA(2, sweeps=3000).estimate(np.ones(2), true.dense, None)
    np.testing.assert_allclose(found.dense, true.dense, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(found.noise, true.noise, rtol=0.1)


def test_mfa_rescaled_columns_give_rescaled_covariance(rng):
    """Unlike with MPPCA."""
    S, counts = samples(rng, 3, 5)
    scale = 10.0 ** rng.uniform(-4.0, 4.0, size=5)
    scaled = S * scale * scale[:, None]
    original, rescaled = (MFA(2).estimate(counts, M, None).dense for M in (S, scaled))
    np.testing.assert_allclose(rescaled, original * scale * scale[:, None], rtol=1e-8)


def test_zero_factors_equal_diagonal_or_spherical(rng):
    S, counts = samples(rng, 3, 4)
    for latent_one, plain in ((MFA(0), Diagonal()), (MPPCA(0), Spherical()), (HDDC(0), Spherical())):
        expected = plain.estimate(counts, S, None).dense
        np.testing.assert_allclose(latent_one.estimate(counts, S, None).dense, expected, atol=1e-12)


@pytest.mark.parametrize("structure", [MPPCA(4), HDDC(4), HDDC((4, 4))])
def test_all_but_one_components_equal_full(rng, structure):
    S, counts = samples(rng, 2, 5)
    np.testing.assert_allclose(structure.estimate(counts, S, None).dense, S, atol=1e-9)


def test_hddc_fraction_keeps_fewest_directions_that_explain_it(rng):
    S, counts = samples(rng, 4, 6)
    dimensions = HDDC(0.9).estimate(counts, S, None).factors
    for values, d in zip(np.linalg.eigvalsh(S)[:, ::-1], dimensions, strict=True):
        assert d == 5 or values[:d].sum() >= 0.9 * values.sum()
        assert values[: d - 1].sum() < 0.9 * values.sum()


def test_hddc_fraction_continued_fit_never_loses_directions(rng):
    wide, counts = np.tile(np.eye(5), (2, 1, 1)), np.ones(2)
    narrow = np.tile(np.diag([1e3, 1.0, 1.0, 1.0, 1.0]), (2, 1, 1))
    structure = HDDC(0.7)
    first = structure.estimate(counts, narrow, None)
    np.testing.assert_array_equal(first.factors, [1, 1])
    spread = structure.estimate(counts, wide * np.arange(1.0, 6.0), first)
    np.testing.assert_array_equal(spread.factors, [3, 3])
    np.testing.assert_array_equal(
        structure.estimate(counts, narrow * np.arange(1.0, 6.0), spread).factors, [3, 3]
    )


def test_mfa_more_factors_are_more_likely(rng):
    S, counts = samples(rng, 3, 6)
    for structure in (MFA, HDDC):
        values = [auxiliary(counts, S, structure(d).estimate(counts, S, None).dense) for d in range(6)]
        assert all(more > less for less, more in pairwise(values))


@pytest.mark.parametrize("structure", [MFA(6), MPPCA(6), HDDC(6), HDDC(0.99)])
def test_estimate_fewer_points_than_factors_is_definite_with_regularisation(rng, structure):
    """Three points in eight columns span two directions; every variance is raised by 0.01."""
    points = rng.normal(size=(3, 8))
    S = np.cov(points.T, bias=True)[None] + 0.01 * np.eye(8)
    found = structure.estimate(np.array([3.0]), S, None)
    W = found.precision_cholesky("the covariance of state")
    np.testing.assert_allclose(W @ found.dense @ W.transpose(0, 2, 1), np.eye(8)[None], atol=1e-9)


@pytest.mark.parametrize("structure", [MPPCA(3), HDDC(3)])
def test_estimate_no_variance_outside_leading_directions_raises(rng, structure):
    points = rng.normal(size=(4, 8))
    S = np.cov(points.T, bias=True)[None]
    with pytest.raises(NotPositiveDefinite, match="state 0"):
        structure.estimate(np.array([4.0]), S, None)


@pytest.mark.parametrize("structure", [MFA(1), MPPCA(1)])
def test_estimate_constant_column_raises_with_index(rng, structure):
    S, counts = samples(rng, 2, 3)
    S[1, 2], S[1, :, 2] = 0.0, 0.0
    with pytest.raises(NotPositiveDefinite, match=r"state 1 .* column 2"):
        structure.estimate(counts, S, None)


def test_mfa_noise_stops_at_min_noise(rng):
    """A column that equals one factor would have zero noise."""
    x = rng.normal(size=(500, 4)) @ np.diag([1.0, 1.0, 0.1, 0.1])
    x[:, 2:] += x[:, :2]
    S = np.cov(np.hstack([x, x[:, :1]]).T, bias=True)[None]
    found = MFA(2, sweeps=200, min_noise=1e-4).estimate(np.ones(1), S, None)
    share = found.noise / np.diagonal(S, axis1=1, axis2=2)
    np.testing.assert_allclose(share.min(), 1e-4)


@pytest.mark.parametrize("structure", [MFA(2, min_noise=0.2), MPPCA(2, min_noise=0.2)])
def test_estimate_previous_noise_below_min_noise_is_kept(rng, structure):
    """Starting at covariances equal to those of the samples, which are optimal."""
    loadings = np.linalg.qr(rng.normal(size=(6, 2)))[0][None]
    true = LatentCovariances(3.0 * loadings, np.full((1, 6), 0.01))
    np.testing.assert_allclose(structure.estimate(np.ones(1), true.dense, true).dense, true.dense, rtol=1e-6)


@pytest.mark.parametrize("structure", [MFA(1), MPPCA(1)])
def test_estimate_start_without_factors_finds_later_factor(rng, structure):
    """A fit that starts from uncorrelated columns of equal variance finds a factor in later samples."""
    true = np.linalg.qr(rng.normal(size=(2, 5, 1)))[0]
    S = 3.0 * true @ true.transpose(0, 2, 1) + np.eye(5)
    start = structure.estimate(np.ones(2), np.tile(np.eye(5), (2, 1, 1)), None)
    found = replace(structure, sweeps=500).estimate(np.ones(2), S, start)
    np.testing.assert_allclose(found.dense, S, atol=1e-3)


@pytest.mark.parametrize("structure", [MFA(2), MPPCA(2), HDDC(0.8)])
def test_estimate_previous_of_other_kind_or_size_is_ignored(rng, structure):
    S, counts = samples(rng, 3, 5)
    fresh = structure.estimate(counts, S, None).dense
    for previous in (Full().estimate(counts, S, None), latent(rng, 2, 5, 2), latent(rng, 3, 5, 1)):
        found = structure.estimate(counts, S, previous)
        if not isinstance(structure, HDDC) or len(previous.dense) != 3:
            np.testing.assert_allclose(found.dense, fresh)


@pytest.mark.parametrize("make", [MFA, MPPCA, HDDC])
@pytest.mark.parametrize("factors", [-1, -5])
def test_structure_negative_factors_raises(make, factors):
    with pytest.raises(InvalidInput, match=r"factors|components|dimensions"):
        make(factors)


@pytest.mark.parametrize("structure", [MFA(5), MPPCA(5), HDDC((5, 1)), HDDC((1, 2, 3))])
def test_estimate_too_many_factors_or_wrong_tuple_raises(rng, structure):
    S, counts = samples(rng, 2, 5)
    with pytest.raises(InvalidInput, match=r"fewer factors than columns|3 dimensions for 2 states"):
        structure.estimate(counts, S, None)


@pytest.mark.parametrize("share", [0.0, 1.0, np.nan])
def test_hddc_fraction_outside_zero_to_one_raises(share):
    with pytest.raises(InvalidInput, match="fraction"):
        HDDC(share)


@pytest.mark.parametrize("setting", [{"sweeps": 0}, {"min_noise": 0.0}, {"min_noise": np.nan}])
def test_structure_invalid_settings_raise_with_name(setting):
    with pytest.raises(InvalidInput, match=next(iter(setting))):
        MFA(2, **setting)
