"""A frame is heard about a state to the power of its relevance, and not at all at zero."""

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


def test_relevance_one_changes_nothing(skill, make_demonstrations):
    frames = make_demonstrations(frames=3)[0].frames
    weighted, plain = adapt(skill, frames, relevance=np.ones((3, 3))), adapt(skill, frames)
    np.testing.assert_array_equal(weighted.means, plain.means)
    np.testing.assert_array_equal(weighted.covariances, plain.covariances)


def test_the_adapted_density_is_the_product_of_the_frames_densities_to_their_powers(
    skill, make_demonstrations, rng
):
    """Log p(x) - sum_j r_j log p_j(x) is one constant, wherever x is."""
    frames, pool_weights = make_demonstrations(frames=3)[0].frames, rng.uniform(0.05, 1.0, size=(3, 3))
    pool_weights[1, 2] = 0.0
    here, x = adapt(skill, frames, relevance=pool_weights), rng.normal(size=(9, 2))
    for k in range(3):
        said = [
            affine_transform(Gaussian(skill.means[p, k], skill.covariances[p].dense[k]), f.A, f.b)
            for p, f in enumerate(frames)
        ]
        weighed = sum(r * log_density(g, x) for r, g in zip(pool_weights[:, k], said, strict=True))
        difference = log_density(Gaussian(here.means[k], here.covariances[k]), x) - weighed
        np.testing.assert_allclose(difference, difference[0], atol=1e-8)


def test_frame_with_zero_relevance_does_not_affect_adaptation(skill, make_demonstrations, rng):
    frames = list(make_demonstrations(frames=3)[0].frames)
    pool_weights = np.array([[0.0] * 3, [1.0] * 3, [0.7] * 3])
    moved = [replace(frames[0], b=frames[0].b + 100.0 * rng.normal(size=2)), *frames[1:]]
    here, there = (adapt(skill, given, relevance=pool_weights) for given in (frames, moved))
    np.testing.assert_array_equal(there.means, here.means)
    np.testing.assert_array_equal(there.covariances, here.covariances)


def test_rows_of_relevance_follow_the_order_of_the_skills_frames(skill, make_demonstrations, rng):
    """However the frames themselves are listed."""
    frames, pool_weights = make_demonstrations(frames=3)[0].frames, rng.uniform(0.1, 1.0, size=(3, 3))
    one, other = (adapt(skill, given, relevance=pool_weights) for given in (frames, frames[::-1]))
    np.testing.assert_array_equal(other.means, one.means)


def test_frame_with_zero_relevance_does_not_affect_signs(skill):
    """Frames told by q or -q agree with those that are heard, though one not heard lies between them."""
    layout = pose_layout()
    turned = (
        np.array([1.0, 0.0, 0.0, 0.0]),
        quaternion_exp(np.array([1.2, 0.0, 0.0])),
        quaternion_exp(np.array([2.3, 0.0, 0.0])),
    )
    means = np.zeros((3, 1, 7))
    means[..., 3] = 1.0
    spreads = tuple(DenseCovariances(s * np.eye(7)[None]) for s in (1e-6, 1e-2, 1e-2))
    known = replace(
        skill,
        dynamics=replace(skill.dynamics, initial=np.ones(1), transitions=np.ones((1, 1))),
        means=means,
        covariances=spreads,
        layout=layout,
    )
    pool_weights = np.array([[0.0], [1.0], [1.0]])
    for signs in product((1.0, -1.0), repeat=3):
        frames = [
            frame_from_pose(f"object {p}", layout, Pose(np.zeros(3), sign * q))
            for p, (sign, q) in enumerate(zip(signs, turned, strict=True))
        ]
        fused = adapt(known, frames, relevance=pool_weights).means[0, 3:]
        assert abs(fused @ quaternion_exp(np.array([1.75, 0.0, 0.0]))) == pytest.approx(1.0, abs=1e-12)


def test_unusable_relevance_is_refused(skill, make_demonstrations):
    frames, good = make_demonstrations(frames=3)[0].frames, np.ones((3, 3))
    deaf = good.copy()
    deaf[:, 1] = 0.0
    cases = [
        (good[:2], r"expected \(3, 3\)"),
        (good * np.nan, "expected 0 to 1"),
        (good * 1.1, "expected 0 to 1"),
        (deaf, "state 1"),
    ]
    for relevance, message in cases:
        with pytest.raises(InvalidInput, match=message):
            adapt(skill, frames, relevance=relevance)
