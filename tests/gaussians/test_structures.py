"""Covariance structures: each is the likeliest of its kind, and counts its parameters truly."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import (
    EMLLT,
    HDDC,
    MFA,
    MLT,
    MPPCA,
    Diagonal,
    ExpandedPrecisions,
    Full,
    LatentCovariances,
    MultipleTransformCovariances,
    SemiTied,
    Spherical,
    component_correlation,
)


def samples(rng, K, D):
    A = rng.normal(size=(K, D, D))
    return A @ A.transpose(0, 2, 1) + 0.05 * np.eye(D), rng.uniform(1.0, 50.0, size=K)


def auxiliary(counts, S, covariances):
    """Return twice the expected log-likelihood that an M-step maximises (4.18), up to a constant."""
    fit = np.trace(np.linalg.solve(covariances, S), axis1=1, axis2=2)
    return -float(counts @ (np.linalg.slogdet(covariances)[1] + fit))


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical(), SemiTied(), SemiTied(0.4)])
def test_estimate_is_symmetric_and_positive_definite(rng, structure):
    S, counts = samples(rng, 5, 6)
    dense = structure.estimate(counts, S, None).dense
    np.testing.assert_allclose(dense, dense.transpose(0, 2, 1), atol=1e-12)
    assert np.linalg.eigvalsh(dense).min() > 0.0


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical()])
def test_estimate_scaled_neighbours_are_less_likely(rng, structure):
    S, counts = samples(rng, 4, 5)
    best = structure.estimate(counts, S, None).dense
    for factor in (0.9, 0.99, 1.01, 1.1):
        assert auxiliary(counts, S, factor * best) < auxiliary(counts, S, best)


@pytest.mark.parametrize("sweeps", [1, 5])
def test_semi_tied_continued_estimates_never_lower_likelihood(rng, sweeps):
    S, counts = samples(rng, 5, 6)
    values, before = [], None
    for _ in range(12):
        before = SemiTied(1.0, sweeps).estimate(counts, S, before)
        values.append(auxiliary(counts, S, before.dense))
    assert np.diff(values).min() >= -1e-9 * abs(values[-1])
    assert values[-1] > auxiliary(counts, S, Diagonal().estimate(counts, S, None).dense)


def test_semi_tied_shared_basis_is_exact(rng):
    """Samples generated as Sigma_i = H D_i H^T are reproduced."""
    H, D = rng.normal(size=(4, 4)), rng.uniform(0.2, 3.0, size=(6, 4))
    S = np.einsum("id,kd,jd->kij", H, D, H)
    tied = SemiTied(1.0, sweeps=400).estimate(np.ones(6), S, None)
    np.testing.assert_allclose(tied.dense, S, rtol=1e-4, atol=1e-4 * np.abs(S).max())
    np.testing.assert_allclose(tied.dense, np.einsum("id,kd,jd->kij", tied.basis, tied.variances, tied.basis))


def test_semi_tied_one_state_equals_full(rng):
    S, counts = samples(rng, 1, 5)
    np.testing.assert_allclose(SemiTied(1.0, sweeps=300).estimate(counts, S, None).dense, S, atol=1e-6)


def test_semi_tied_tying_mixes_tied_and_full(rng):
    S, counts = samples(rng, 4, 5)
    tied = SemiTied(1.0).estimate(counts, S, None).dense
    np.testing.assert_allclose(SemiTied(0.3).estimate(counts, S, None).dense, 0.3 * tied + 0.7 * S)
    np.testing.assert_allclose(SemiTied(0.0).estimate(counts, S, None).dense, S)


@pytest.mark.parametrize("tying", [-0.1, 1.1, np.nan])
def test_semi_tied_tying_outside_zero_to_one_raises(tying):
    with pytest.raises(InvalidInput, match="tying"):
        SemiTied(tying)


@pytest.mark.parametrize(
    ("structure", "states", "width", "count"),
    [
        (Full(), 7, 14, 735),
        (SemiTied(0.5), 7, 14, 735),
        (SemiTied(1.0), 7, 14, 294),
        (Full(), 75, 94, 334_875),
        (SemiTied(1.0), 75, 94, 15_886),
        (Diagonal(), 7, 14, 98),
        (Spherical(), 7, 14, 7),
        (MFA(4), 3, 14, 210),
        (MFA(4), 4, 14, 280),
        (MPPCA(4), 3, 14, 171),
        (HDDC(4), 3, 14, 171),
        (HDDC((4, 3, 4)), 3, 14, 154 + 3),
        (HDDC((5, 5, 4, 3)), 4, 14, 238 + 4),
        (EMLLT(14), 7, 14, 294),
        (EMLLT(20), 7, 14, 420),
        (MLT(1), 7, 14, 294),
        (MLT(3), 7, 14, 686),
    ],
)
def test_parameter_count_equals_thesis(structure, states, width, count):
    """Tanwani 2018, sections 4.2.2-4.2.3, table 4.1 (half of 1470 and 588, for one of two frames), table 5.1.

    Table 5.1 does not count the noise variance of a state with a subspace.
    """
    assert structure.parameter_count(states, width) == count


def latent(numbers, K, D, d, isotropic):
    """Return K covariances of d factors from their parameters."""
    loadings, noise = np.split(numbers, [K * D * d])
    noise = np.repeat(noise, D) if isotropic else noise
    return LatentCovariances(loadings.reshape(K, D, d), np.exp(noise).reshape(K, D)).dense


def expansion(numbers, K, D, R):
    directions, weights = np.split(numbers, [R * D])
    return ExpandedPrecisions(directions.reshape(R, D), np.exp(weights).reshape(K, R)).dense


def transforms(numbers, K, D, C):
    bases, variances = np.split(numbers, [C * D * D])
    membership = np.eye(C)[np.arange(K) % C]
    return MultipleTransformCovariances(
        bases.reshape(C, D, D), np.exp(variances).reshape(K, D), membership
    ).dense


FAMILIES = {
    "MFA(1)": (MFA(1), lambda v, K, D: latent(v, K, D, 1, False)),
    "MFA(2)": (MFA(2), lambda v, K, D: latent(v, K, D, 2, False)),
    "MFA(3), more numbers than a covariance": (MFA(3), lambda v, K, D: latent(v, K, D, 3, False)),
    "MPPCA(2)": (MPPCA(2), lambda v, K, D: latent(v, K, D, 2, True)),
    "MPPCA(3)": (MPPCA(3), lambda v, K, D: latent(v, K, D, 3, True)),
    "HDDC(2)": (HDDC(2), lambda v, K, D: latent(v, K, D, 2, True)),
    "semi-tied": (SemiTied(), lambda v, K, D: transforms(v, K, D, 1)),
    "EMLLT(6)": (EMLLT(6), lambda v, K, D: expansion(v, K, D, 6)),
    "EMLLT(15), full": (EMLLT(15), lambda v, K, D: expansion(v, K, D, 15)),
    "MLT(2)": (MLT(2), lambda v, K, D: transforms(v, K, D, 2)),
}


@pytest.mark.parametrize("K", [1, 2, 4])
@pytest.mark.parametrize("name", FAMILIES)
def test_degrees_of_freedom_equal_rank_of_derivative(rng, name, K):
    """Derivative of the covariances by all parameters, at random parameters."""
    structure, covariances = FAMILIES[name]
    K, D = K * (2 if isinstance(structure, MLT) else 1), 5  # as many states for either basis
    numbers = rng.normal(size=structure.parameter_count(K, D))
    steps = 1e-5 * np.eye(len(numbers))
    slopes = [covariances(numbers + h, K, D) - covariances(numbers - h, K, D) for h in steps]
    slopes = np.stack(slopes).reshape(len(numbers), -1) / 2e-5
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    assert np.linalg.matrix_rank(slopes, tol=1e-7) == structure.degrees_of_freedom(K, D)


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical(), SemiTied(0.5)])
def test_degrees_of_freedom_without_redundancy_equal_parameter_count(structure):
    assert structure.degrees_of_freedom(5, 4) == structure.parameter_count(5, 4)


def test_hddc_fraction_parameters_are_counted_after_fit(rng):
    S, counts = samples(rng, 3, 5)
    structure = HDDC(0.8)
    fitted = structure.fitted(structure.estimate(counts, S, None))
    np.testing.assert_allclose(
        fitted.estimate(counts, S, None).dense, structure.estimate(counts, S, None).dense, atol=1e-12
    )
    for count in (structure.parameter_count, structure.degrees_of_freedom):
        with pytest.raises(InvalidInput, match="fitted"):
            count(3, 5)


def test_component_correlation_multiples_is_one_and_symmetric(rng):
    S, _ = samples(rng, 3, 4)
    M = component_correlation(np.concatenate([S, 2.5 * S[:1]]))
    np.testing.assert_allclose(M[0, 3], 1.0)
    np.testing.assert_allclose(M, M.T)
    assert np.abs(M).max() <= 1.0 + 1e-12


def test_semi_tied_continues_from_previous_basis(rng):
    """Two sweeps equal one sweep and another one."""
    S, counts = samples(rng, 5, 6)
    one = SemiTied(1.0, sweeps=1)
    twice = one.estimate(counts, S, one.estimate(counts, S, None)).dense
    np.testing.assert_allclose(
        twice, SemiTied(1.0, sweeps=2).estimate(counts, S, None).dense, rtol=1e-8, atol=1e-10
    )
