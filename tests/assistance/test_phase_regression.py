"""Regression on the phase and the product over frames, by independent methods."""

import numpy as np
import pytest
from annotations import check_annotations

from pilotfish.assistance import VirtualFixture, learn_virtual_fixture, phase_regression
from pilotfish.assistance.phase import path_phase
from pilotfish.assistance.phase_regression import (
    Guide,
    _local_regression,
    _responsibilities,
    regress_on_phase,
)
from pilotfish.demonstrations import Frame
from pilotfish.gaussians import Gaussian, RiemannianGaussian, affine_transform, product
from pilotfish.gaussians.structures import (
    EMLLT,
    HDDC,
    MFA,
    MLT,
    MPPCA,
    STRUCTURES,
    Diagonal,
    Full,
    SemiTied,
    Spherical,
)
from pilotfish.geometry import log_map

STARTS = (3,)  # of the quaternion among points
EXAMPLES = (
    Full(),
    Diagonal(),
    Spherical(),
    SemiTied(),
    MFA(2),
    MPPCA(2),
    HDDC(2),
    EMLLT(12),
    MLT(2),
)
STEP = 1e-5  # of the phase: differences of fourth order are exact to about 1e-9


def learned(demos, **choices) -> VirtualFixture:
    with check_annotations(False):  # those of learning are checked by its own tests
        return learn_virtual_fixture(demos[:-1], rng=np.random.default_rng(0), **choices)


def difference(at, s):
    """Return the derivative of an array by the phase, of fourth order."""
    return (8.0 * (at(s + STEP) - at(s - STEP)) - (at(s + 2 * STEP) - at(s - 2 * STEP))) / (12.0 * STEP)


def numerical_jacobian(fixture: VirtualFixture, frames: list[Frame], s: np.ndarray) -> np.ndarray:
    means = regress_on_phase(fixture.mixture, frames, s).means
    return difference(lambda r: log_map(means, regress_on_phase(fixture.mixture, frames, r).means, STARTS), s)


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest relative error of rows; rows below 1 % of the longest count as that long."""
    lengths = np.linalg.norm(expected, axis=1)
    errors = np.linalg.norm(found - expected, axis=1)
    return float((errors / np.maximum(lengths, 0.01 * lengths.max())).max())


def test_examples_have_every_structure():
    assert {type(structure) for structure in EXAMPLES} == set(STRUCTURES.values())


@pytest.mark.parametrize("sphere", [False, True], ids=["flat", "sphere"])
@pytest.mark.parametrize("structure", EXAMPLES, ids=lambda s: s.label)
def test_jacobian_equals_finite_differences(make, structure, sphere):
    demos = make(sphere=sphere)
    fixture, frames = learned(demos, structure=structure, states=7), list(demos[-1].frames)
    s = np.linspace(0.02, 0.98, 33)
    guide = regress_on_phase(fixture.mixture, frames, s)
    assert relative_error(guide.jacobians, numerical_jacobian(fixture, frames, s)) < 1e-6


@pytest.mark.parametrize("sphere", [False, True], ids=["flat", "sphere"])
def test_covariance_derivative_equals_finite_differences(make, sphere):
    demos = make(sphere=sphere)
    mixture = learned(demos, states=6).mixture
    s = np.linspace(0.02, 0.98, 21)

    def covariances(phases: np.ndarray) -> np.ndarray:
        h, dh = _responsibilities(mixture, phases)
        return _local_regression(mixture.frames[1], phases, h, dh)[1]

    h, dh = _responsibilities(mixture, s)
    found = _local_regression(mixture.frames[1], s, h, dh)[3].reshape(len(s), -1)
    expected = difference(covariances, s).reshape(len(s), -1)
    assert relative_error(found, expected) < 1e-6


@pytest.mark.parametrize("sphere", [False, True], ids=["flat", "sphere"])
def test_product_equals_product_of_gaussians(make, sphere):
    demos = make(sphere=sphere)
    mixture = learned(demos, states=6).mixture
    s, frames = np.linspace(0.0, 1.0, 7), demos[-1].frames
    guide = regress_on_phase(mixture, list(frames), s)
    h, dh = _responsibilities(mixture, s)
    for n in range(len(s)):
        factors = []
        for conditional, frame in zip(mixture.frames, frames, strict=True):
            m, S, _, _ = (a[n] for a in _local_regression(conditional, s, h, dh))
            if sphere:
                T = frame.tangent_map(mixture.layout)
                factors.append(RiemannianGaussian(frame.A @ m + frame.b, T @ S @ T.T, STARTS))
            else:
                factors.append(affine_transform(Gaussian(m, S), frame.A, frame.b))
        expected = RiemannianGaussian.product(factors) if sphere else product(factors)
        mean = expected.mean.copy()
        mean[3:] /= np.linalg.norm(mean[3:])
        np.testing.assert_allclose(log_map(guide.means[n], mean, STARTS), 0.0, atol=1e-8)
        if sphere:
            np.testing.assert_allclose(guide.covariances[n], expected.covariance, rtol=1e-6, atol=1e-12)


def test_regression_and_product_equal_importance_sampling(make):
    """The product density is that of samples from one frame, weighted by the density in the other."""
    rng, demos = np.random.default_rng(3), make(central=True)
    mixture = learned(demos, states=6).mixture
    s, frames = np.array([0.33]), list(demos[-1].frames)
    guide, (h, _) = regress_on_phase(mixture, frames, s), _responsibilities(mixture, s)
    moments = []
    for conditional, frame in zip(mixture.frames, frames, strict=True):
        k = rng.choice(h.shape[1], size=400_000, p=h[0])
        at = conditional.means + conditional.slopes[..., 0] * (s - conditional.input_means)
        noise = np.einsum(
            "nij,nj->ni", np.linalg.cholesky(conditional.covariances)[k], rng.normal(size=(len(k), 7))
        )
        x = (at[k] + noise) @ frame.A.T + frame.b
        moments.append((x[:, :3].mean(axis=0), np.cov(x.T), x.mean(axis=0)))
    precisions = [np.linalg.inv(S) for _, S, _ in moments]
    covariance = np.linalg.inv(sum(precisions))
    mean = covariance @ sum(L @ m for L, (_, _, m) in zip(precisions, moments, strict=True))
    deviations = np.sqrt(np.diag(covariance))
    assert np.abs(guide.means[0, :3] - mean[:3]).max() < 0.02 * deviations[:3].max()
    np.testing.assert_allclose(np.sqrt(np.diag(guide.covariances[0]))[:3], deviations[:3], rtol=0.02)


def test_shrinkage_brings_the_path_of_a_new_scene_nearer(make, monkeypatch):
    """Without it the frames disagree in directions that five demonstrations did not vary."""
    demos = make()
    demo, shares = demos[-1], np.linspace(0.0, 1.0, 20)
    errors = []
    for share in (phase_regression.SHRINKAGE, 0.0):
        monkeypatch.setattr(phase_regression, "SHRINKAGE", share)
        fixture = learned(demos)
        s = path_phase(demo.x, fixture.damping**-0.5, STARTS)
        rows = np.abs(s[:, None] - shares).argmin(axis=0)
        means = regress_on_phase(fixture.mixture, list(demo.frames), s[rows]).means
        errors.append(np.linalg.norm((means - demo.x[rows])[:, :3], axis=1).mean())
    assert errors[0] < errors[1]


def test_covariance_of_quaternion_is_that_of_its_rotation_vectors(make):
    """Samples of q in R^4, normalised, have rotation vectors of the reported covariance."""
    rng, demos = np.random.default_rng(5), make()
    mixture, frames = learned(demos, states=6).mixture, list(demos[-1].frames)
    s = np.array([0.4])
    guide, (h, dh) = regress_on_phase(mixture, frames, s), _responsibilities(mixture, s)
    factors = [
        affine_transform(Gaussian(m[0], S[0]), frame.A, frame.b)
        for (m, S, _, _), frame in (
            (_local_regression(c, s, h, dh), f) for c, f in zip(mixture.frames, frames, strict=True)
        )
    ]
    flat = product(factors)
    x = rng.multivariate_normal(flat.mean, flat.covariance, size=200_000)
    x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
    sampled = np.cov(log_map(guide.means[0], x, STARTS).T)
    np.testing.assert_allclose(np.diag(guide.covariances[0]), np.diag(sampled), rtol=0.02)


@pytest.mark.parametrize("sphere", [False, True], ids=["flat", "sphere"])
def test_negated_frame_quaternion_gives_the_same_guide(make, sphere):
    demos = make(sphere=sphere)
    fixture, s = learned(demos, states=6), np.linspace(0.0, 1.0, 9)
    base, target = demos[-1].frames
    A = target.A.copy()
    A[3:, 3:] *= -1.0
    found = regress_on_phase(fixture.mixture, [base, Frame("object", A, target.b)], s)
    expected: Guide = regress_on_phase(fixture.mixture, [base, target], s)
    np.testing.assert_allclose(log_map(found.means, expected.means, STARTS), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.jacobians, expected.jacobians, atol=1e-8)


def test_jacobian_is_finite_far_from_every_state(make):
    demos = make(sphere=True)
    fixture = learned(demos, states=20)
    guide = regress_on_phase(fixture.mixture, list(demos[-1].frames), np.array([-2.0, 0.0, 1.0, 3.0]))
    assert np.isfinite(guide.means).all()
    assert np.isfinite(guide.jacobians).all()
