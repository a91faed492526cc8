"""q and -q are one orientation, whoever speaks: a frame, or the robot at the start."""

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
def rotating_skill(rng):
    """Tools that turn from one object's orientation to another's, in five random situations."""

    def situation():
        home = quaternion_exp(0.3 * rng.normal(size=3))
        return Pose(rng.normal(size=3), home), Pose(
            rng.normal(size=3), multiply(from_rotation_vector(rng.normal(size=3)), home)
        )

    def shown(a, b):
        s = np.linspace(0.0, 1.0, 40)[:, None]
        q = (1 - s) * a.quaternion + s * b.quaternion + 0.002 * rng.normal(size=(40, 4))
        x = np.hstack([(1 - s) * a.position + s * b.position, q / np.linalg.norm(q, axis=1, keepdims=True)])
        frames = [frame_from_pose(n, pose_layout(), p) for n, p in (("a", a), ("b", b))]
        return add_derivatives(demonstration(x, 0.1, pose_layout(), frames))

    return [shown(*situation()) for _ in range(5)]


def test_a_frame_may_be_given_by_either_quaternion(rng, rotating_skill):
    """All four choices of sign for two objects adapt to one skill, up to one common sign."""
    skill, frames = learn(rotating_skill, states=4, rng=rng).skill, rotating_skill[0].frames
    expected = adapt(skill, frames)
    for choice in product((False, True), repeat=2):
        given = [
            replace(f, A=SIGNS[:, None] * f.A) if flip else f for f, flip in zip(frames, choice, strict=True)
        ]
        here = adapt(skill, given)
        signs = SIGNS if choice[0] else np.ones(14)
        np.testing.assert_allclose(here.means, signs * expected.means, atol=1e-12)
        np.testing.assert_allclose(
            here.covariances, np.outer(signs, signs) * expected.covariances, atol=1e-12
        )


def test_a_robot_that_reports_minus_q_moves_the_same_way(rng, rotating_skill):
    here, start = (
        adapt(learn(rotating_skill, states=4, rng=rng).skill, rotating_skill[0].frames),
        rotating_skill[0].x[0],
    )
    one, other = (
        track(double_integrator(7, 0.1), plan(here, begin, horizon=40), 1.0).rollout(begin)
        for begin in (start, SIGNS * start)
    )
    np.testing.assert_allclose(other.x, SIGNS * one.x, atol=1e-9)
    assert np.linalg.norm(other.x[-1, 3:7] - other.x[0, 3:7]) < 1.0  # nobody turned all the way round


def test_adapted_orientations_are_unit_quaternions(rng, rotating_skill):
    """Fusing frames that disagree shortens a quaternion; the skill that comes out holds rotations."""
    skill = learn(rotating_skill, states=4, rng=rng).skill
    for situation in rotating_skill:
        means = adapt(skill, situation.frames).means
        np.testing.assert_allclose(np.linalg.norm(means[:, 3:7], axis=1), 1.0)


def test_frames_are_held_to_what_they_know_precisely(rng, rotating_skill):
    """One state that both frames know well outweighs two that hardly anyone knows and that point away."""
    skill = learn(rotating_skill, states=3, rng=rng).skill
    q, away = np.array([1.0, 0, 0, 0]), np.array([-1.0, 0, 0, 0])
    means = np.zeros((2, 3, 14))
    means[0, :, 3:7], means[1, :, 3:7] = q, (q, away, away)
    spread = np.array([1e-4, 10.0, 10.0])[:, None, None] * np.eye(14)
    known = replace(skill, means=means, covariances=(DenseCovariances(spread), DenseCovariances(spread)))
    frames = [replace(f, A=np.eye(14), b=np.zeros(14)) for f in rotating_skill[0].frames]
    means[1, 1:, 4] = 0.5  # not quite opposite, so that the fused orientation has a length
    np.testing.assert_allclose(adapt(known, frames).means[0, 3:7], q)
