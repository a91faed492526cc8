"""Signs of quaternions of frames and of the robot's start."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import (
    add_derivatives,
    demonstration,
    frame_from_pose,
    pose_layout,
)
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import Pose, from_rotation_vector, multiply, quaternion_exp
from pilotfish.models import adapt, learn
from pilotfish.planning import plan

SIGNS = np.repeat([1.0, -1.0, 1.0, -1.0], [3, 4, 3, 4])  # negates a quaternion and its derivative


@pytest.fixture
def rotations(rng):
    """Return demonstrations that rotate from one object to another, in five random situations."""

    def situation():
        home = quaternion_exp(0.3 * rng.normal(size=3))
        return Pose(rng.normal(size=3), home), Pose(
            rng.normal(size=3), multiply(from_rotation_vector(rng.normal(size=3)), home)
        )

    def demonstrate(a, b):
        s = np.linspace(0.0, 1.0, 40)[:, None]
        q = (1 - s) * a.quaternion + s * b.quaternion + 0.002 * rng.normal(size=(40, 4))
        x = np.hstack([(1 - s) * a.position + s * b.position, q / np.linalg.norm(q, axis=1, keepdims=True)])
        frames = [frame_from_pose(n, pose_layout(), p) for n, p in (("a", a), ("b", b))]
        return add_derivatives(demonstration(x, 0.1, pose_layout(), frames))

    return [demonstrate(*situation()) for _ in range(5)]


def test_adapt_negated_frame_quaternions_give_same_skill(rng, rotations):
    """All four choices of sign for two frames give one skill, up to one common sign."""
    skill, frames = learn(rotations, states=4, rng=rng).skill, rotations[0].frames
    expected = adapt(skill, frames)
    for choice in product((False, True), repeat=2):
        given = [
            replace(f, A=SIGNS[:, None] * f.A) if flip else f for f, flip in zip(frames, choice, strict=True)
        ]
        adapted = adapt(skill, given)
        signs = SIGNS if choice[0] else np.ones(14)
        np.testing.assert_allclose(adapted.means, signs * expected.means, atol=1e-12)
        np.testing.assert_allclose(
            adapted.covariances, np.outer(signs, signs) * expected.covariances, atol=1e-12
        )


def test_plan_negated_start_gives_same_motion(rng, rotations):
    """The motion does not rotate by 360 degrees."""
    adapted, start = (
        adapt(learn(rotations, states=4, rng=rng).skill, rotations[0].frames),
        rotations[0].x[0],
    )
    one, other = (
        track(double_integrator(7, 0.1), plan(adapted, begin, horizon=40), 1.0).rollout(begin)
        for begin in (start, SIGNS * start)
    )
    np.testing.assert_allclose(other.x, SIGNS * one.x, atol=1e-9)
    assert np.linalg.norm(other.x[-1, 3:7] - other.x[0, 3:7]) < 1.0


def test_adapt_quaternions_have_unit_norm(rng, rotations):
    """The product of frames that disagree shortens a quaternion, which is then normalised."""
    skill = learn(rotations, states=4, rng=rng).skill
    for situation in rotations:
        means = adapt(skill, situation.frames).means
        np.testing.assert_allclose(np.linalg.norm(means[:, 3:7], axis=1), 1.0)


def test_adapt_signs_follow_precise_states(rng, rotations):
    """One precise state outweighs two imprecise states of opposite orientation."""
    skill = learn(rotations, states=3, rng=rng).skill
    q, opposite = np.array([1.0, 0, 0, 0]), np.array([-1.0, 0, 0, 0])
    means = np.zeros((2, 3, 14))
    means[0, :, 3:7], means[1, :, 3:7] = q, (q, opposite, opposite)
    covariances = np.array([1e-4, 10.0, 10.0])[:, None, None] * np.eye(14)
    precise = replace(
        skill, means=means, covariances=(DenseCovariances(covariances), DenseCovariances(covariances))
    )
    frames = [replace(f, A=np.eye(14), b=np.zeros(14)) for f in rotations[0].frames]
    means[1, 1:, 4] = 0.5  # not exactly opposite, so that the product has a norm
    np.testing.assert_allclose(adapt(precise, frames).means[0, 3:7], q)
