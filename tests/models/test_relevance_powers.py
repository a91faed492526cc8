"""Adaptation with relevance: covariances divided by powers, and frames with relevance 0 excluded."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pilotfish.demonstrations import frame_from_pose, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, affine_transform, log_density
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import Pose, quaternion_exp
from pilotfish.models import adapt, learn


@pytest.fixture
def skill(make_demonstrations, rng):
    return learn(make_demonstrations(frames=3), states=3, rng=rng, dynamics="markov").skill


def test_adapt_relevance_one_equals_unweighted(skill, make_demonstrations):
    frames = make_demonstrations(frames=3)[0].frames
    weighted, plain = adapt(skill, frames, relevance=np.ones((3, 3))), adapt(skill, frames)
    np.testing.assert_array_equal(weighted.means, plain.means)
    np.testing.assert_array_equal(weighted.covariances, plain.covariances)


def test_adapt_density_equals_product_of_powers(skill, make_demonstrations, rng):
    """The difference log p(x) - sum_j r_j log p_j(x) is the same constant for every x."""
    frames, pool_weights = make_demonstrations(frames=3)[0].frames, rng.uniform(0.05, 1.0, size=(3, 3))
    pool_weights[1, 2] = 0.0
    adapted, x = adapt(skill, frames, relevance=pool_weights), rng.normal(size=(9, 2))
    for k in range(3):
        gaussians = [
            affine_transform(Gaussian(skill.means[p, k], skill.covariances[p].dense[k]), f.A, f.b)
            for p, f in enumerate(frames)
        ]
        weighted = sum(r * log_density(g, x) for r, g in zip(pool_weights[:, k], gaussians, strict=True))
        difference = log_density(Gaussian(adapted.means[k], adapted.covariances[k]), x) - weighted
        np.testing.assert_allclose(difference, difference[0], atol=1e-8)


def test_adapt_frame_with_zero_relevance_has_no_effect(skill, make_demonstrations, rng):
    frames = list(make_demonstrations(frames=3)[0].frames)
    pool_weights = np.array([[0.0] * 3, [1.0] * 3, [0.7] * 3])
    moved = [replace(frames[0], b=frames[0].b + 100.0 * rng.normal(size=2)), *frames[1:]]
    one, other = (adapt(skill, given, relevance=pool_weights) for given in (frames, moved))
    np.testing.assert_array_equal(other.means, one.means)
    np.testing.assert_array_equal(other.covariances, one.covariances)


def test_adapt_relevance_rows_follow_frames_of_skill(skill, make_demonstrations, rng):
    """The order of the given frames does not matter."""
    frames, pool_weights = make_demonstrations(frames=3)[0].frames, rng.uniform(0.1, 1.0, size=(3, 3))
    one, other = (adapt(skill, given, relevance=pool_weights) for given in (frames, frames[::-1]))
    np.testing.assert_array_equal(other.means, one.means)


def test_adapt_signs_ignore_frame_with_zero_relevance(skill):
    """Signs of the other frames agree although an excluded frame lies between them."""
    layout = pose_layout()
    orientations = (
        np.array([1.0, 0.0, 0.0, 0.0]),
        quaternion_exp(np.array([1.2, 0.0, 0.0])),
        quaternion_exp(np.array([2.3, 0.0, 0.0])),
    )
    means = np.zeros((3, 1, 7))
    means[..., 3] = 1.0
    covariances = tuple(DenseCovariances(s * np.eye(7)[None]) for s in (1e-6, 1e-2, 1e-2))
    precise = replace(
        skill,
        dynamics=replace(skill.dynamics, initial=np.ones(1), transitions=np.ones((1, 1))),
        means=means,
        covariances=covariances,
        layout=layout,
        regularisation=None,
        demonstrated=None,
        endpoints=None,
    )
    pool_weights = np.array([[0.0], [1.0], [1.0]])
    for signs in product((1.0, -1.0), repeat=3):
        frames = [
            frame_from_pose(f"object {p}", layout, Pose(np.zeros(3), sign * q))
            for p, (sign, q) in enumerate(zip(signs, orientations, strict=True))
        ]
        product_mean = adapt(precise, frames, relevance=pool_weights).means[0, 3:]
        assert abs(product_mean @ quaternion_exp(np.array([1.75, 0.0, 0.0]))) == pytest.approx(1.0, abs=1e-12)


def test_adapt_invalid_relevance_is_refused(skill, make_demonstrations):
    frames, good = make_demonstrations(frames=3)[0].frames, np.ones((3, 3))
    excluded = good.copy()
    excluded[:, 1] = 0.0
    cases = [
        (good[:2], r"expected \(3, 3\)"),
        (good * np.nan, "expected 0 to 1"),
        (good * 1.1, "expected 0 to 1"),
        (excluded, "state 1"),
    ]
    for relevance, message in cases:
        with pytest.raises(InvalidInput, match=message):
            adapt(skill, frames, relevance=relevance)
