"""Covariance structures: each is the likeliest of its kind, and counts its parameters truly."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Diagonal, Full, SemiTied, Spherical, component_correlation


def samples(rng, K, D):
    A = rng.normal(size=(K, D, D))
    return A @ A.transpose(0, 2, 1) + 0.05 * np.eye(D), rng.uniform(1.0, 50.0, size=K)


def auxiliary(mass, S, covariances):
    """Twice the expected log-likelihood that an M-step maximises (4.18), constants left out."""
    fit = np.trace(np.linalg.solve(covariances, S), axis1=1, axis2=2)
    return -float(mass @ (np.linalg.slogdet(covariances)[1] + fit))


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical(), SemiTied(), SemiTied(0.4)])
def test_covariances_are_symmetric_and_positive_definite(rng, structure):
    S, mass = samples(rng, 5, 6)
    dense = structure.estimate(mass, S, None).dense
    np.testing.assert_allclose(dense, dense.transpose(0, 2, 1), atol=1e-12)
    assert np.linalg.eigvalsh(dense).min() > 0.0


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical()])
def test_no_scaled_neighbour_of_the_estimate_is_likelier(rng, structure):
    S, mass = samples(rng, 4, 5)
    best = structure.estimate(mass, S, None).dense
    for factor in (0.9, 0.99, 1.01, 1.1):
        assert auxiliary(mass, S, factor * best) < auxiliary(mass, S, best)


@pytest.mark.parametrize("sweeps", [1, 5])
def test_semi_tied_estimates_never_lose_likelihood_when_they_go_on(rng, sweeps):
    S, mass = samples(rng, 5, 6)
    values, before = [], None
    for _ in range(12):
        before = SemiTied(1.0, sweeps).estimate(mass, S, before)
        values.append(auxiliary(mass, S, before.dense))
    assert np.diff(values).min() >= -1e-9 * abs(values[-1])
    assert values[-1] > auxiliary(mass, S, Diagonal().estimate(mass, S, None).dense)


def test_semi_tied_is_exact_when_the_states_do_share_their_basis(rng):
    """With Sigma_i = H D_i H^T generating the samples, the estimate gives the samples back."""
    H, D = rng.normal(size=(4, 4)), rng.uniform(0.2, 3.0, size=(6, 4))
    S = np.einsum("id,kd,jd->kij", H, D, H)
    tied = SemiTied(1.0, sweeps=400).estimate(np.ones(6), S, None)
    np.testing.assert_allclose(tied.dense, S, rtol=1e-4, atol=1e-4 * np.abs(S).max())
    np.testing.assert_allclose(tied.dense, np.einsum("id,kd,jd->kij", tied.basis, tied.variances, tied.basis))


def test_one_semi_tied_state_is_a_full_covariance(rng):
    S, mass = samples(rng, 1, 5)
    np.testing.assert_allclose(SemiTied(1.0, sweeps=300).estimate(mass, S, None).dense, S, atol=1e-6)


def test_tying_mixes_the_tied_and_the_free_covariance(rng):
    S, mass = samples(rng, 4, 5)
    tied = SemiTied(1.0).estimate(mass, S, None).dense
    np.testing.assert_allclose(SemiTied(0.3).estimate(mass, S, None).dense, 0.3 * tied + 0.7 * S)
    np.testing.assert_allclose(SemiTied(0.0).estimate(mass, S, None).dense, S)


@pytest.mark.parametrize("tying", [-0.1, 1.1, np.nan])
def test_a_tying_outside_0_to_1_is_refused(tying):
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
    ],
)
def test_parameters_of_one_frame_are_counted_as_the_thesis_does(structure, states, width, count):
    """Tanwani 2018, sections 4.2.2-4.2.3 and table 4.1 (half of 1470 and 588, for one of two frames)."""
    assert structure.parameter_count(states, width) == count


def test_component_correlation_is_one_for_multiples_and_symmetric(rng):
    S, _ = samples(rng, 3, 4)
    M = component_correlation(np.concatenate([S, 2.5 * S[:1]]))
    np.testing.assert_allclose(M[0, 3], 1.0)
    np.testing.assert_allclose(M, M.T)
    assert np.abs(M).max() <= 1.0 + 1e-12


def test_semi_tied_goes_on_from_the_basis_before(rng):
    """Two sweeps at once are one sweep and one more."""
    S, mass = samples(rng, 5, 6)
    one = SemiTied(1.0, sweeps=1)
    twice = one.estimate(mass, S, one.estimate(mass, S, None)).dense
    np.testing.assert_allclose(
        twice, SemiTied(1.0, sweeps=2).estimate(mass, S, None).dense, rtol=1e-8, atol=1e-10
    )
