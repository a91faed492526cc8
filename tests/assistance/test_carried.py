"""Carrying a command from the frames observed to the actual frames, and fusing it with the model."""

import assisted_task as task
import numpy as np
import pytest

import pilotfish as pf
from pilotfish.assistance.carried import carried_situation, carry_matrices, mix_points
from pilotfish.assistance.coordinates import coordinate_skill
from pilotfish.assistance.operator_noise import OperatorNoise
from pilotfish.gaussians import Gaussian, product
from pilotfish.geometry import angle, exp_map, log_map

SKILL = coordinate_skill(task.learn())
STARTS = SKILL.layout.orientation_starts
NOISE = OperatorNoise().deviations(SKILL.layout)


def situation(scene, actual, deviations=NOISE):
    return carried_situation(SKILL, task.scene_frames(scene), task.scene_frames(actual), deviations)


def random_row(rng) -> np.ndarray:
    demo = task.demonstrate(rng)
    return demo.x[rng.integers(len(demo.x))].copy()


def one_hot(k: int) -> np.ndarray:
    return np.eye(SKILL.states)[k]


def test_carry_is_the_identity_in_the_same_frames(rng):
    frames = task.scene_frames(task.random_scene(rng))
    assert np.allclose(carry_matrices(SKILL, frames, frames), np.eye(7), atol=1e-12)


def test_command_moves_with_all_objects_together(rng):
    scene, motion = task.random_scene(rng), task.rigid_motion(rng)
    moved = tuple(motion @ pose for pose in scene)
    x, h = random_row(rng), rng.dirichlet(np.ones(SKILL.states))
    still, _ = situation(scene, scene).correct(x, h)
    carried, _ = situation(scene, moved).correct(x, h)
    expected = task.move_row(motion, still)
    assert np.allclose(carried[:3], expected[:3], atol=1e-9)
    assert angle(carried[3:7], expected[3:7]) < 1e-9


def test_mean_of_a_state_is_carried_to_its_mean(rng):
    scene, actual = task.random_scene(rng), task.random_scene(rng)
    observed, adapted = (pf.adapt(SKILL, task.scene_frames(s)) for s in (scene, actual))
    carried = situation(scene, actual)
    for k in range(SKILL.states):
        mean, _ = carried.correct(observed.means[k], one_hot(k))
        assert np.allclose(log_map(adapted.means[k], mean, STARTS), 0.0, atol=1e-9)


def test_carried_position_minimises_the_weighted_distance_to_that_of_each_frame(rng):
    frames, actual = (task.scene_frames(task.random_scene(rng)) for _ in range(2))
    e = rng.normal(size=3)
    C = carry_matrices(SKILL, frames, actual)
    for k in range(SKILL.states):
        rows, values = [], []
        for p, (before, after) in enumerate(zip(frames, actual, strict=True)):
            local = SKILL.covariances[p].dense[k][:3, :3]
            root = np.linalg.inv(np.linalg.cholesky(after.A[:3, :3] @ local @ after.A[:3, :3].T))
            rows.append(root)
            values.append(root @ after.A[:3, :3] @ before.A[:3, :3].T @ e)
        expected = np.linalg.lstsq(np.vstack(rows), np.concatenate(values))[0]
        assert np.allclose(C[k, :3, :3] @ e, expected)


def test_fusion_is_the_product_of_model_and_operator(rng):
    scene, actual, k = task.random_scene(rng), task.random_scene(rng), 3
    observed, adapted = (pf.adapt(SKILL, task.scene_frames(s)) for s in (scene, actual))
    x = exp_map(observed.means[k], 0.03 * rng.normal(size=7), STARTS)
    C = carry_matrices(SKILL, task.scene_frames(scene), task.scene_frames(actual))[k]
    e = C @ log_map(observed.means[k], x, STARTS)
    fused = product([Gaussian(np.zeros(7), adapted.covariances[k]), Gaussian(e, np.diag(NOISE**2))])
    mean, covariance = situation(scene, actual).correct(x, one_hot(k))
    assert np.allclose(log_map(adapted.means[k], mean, STARTS), fused.mean, atol=1e-9)
    assert np.allclose(covariance, fused.covariance, atol=1e-12)


@pytest.mark.parametrize(("deviation", "share"), [(1e-5, 1.0), (1e2, 0.0)])
def test_precise_operator_is_followed_and_imprecise_one_corrected(rng, deviation, share):
    scene, k = task.random_scene(rng), 3
    adapted = pf.adapt(SKILL, task.scene_frames(scene))
    e = 0.02 * rng.normal(size=7)
    x = exp_map(adapted.means[k], e, STARTS)
    mean, _ = situation(scene, scene, np.full(7, deviation)).correct(x, one_hot(k))
    assert np.allclose(log_map(adapted.means[k], mean, STARTS), share * e, atol=1e-3)


def test_density_of_a_command_is_that_of_model_and_noise_together(rng):
    scene, x = task.random_scene(rng), random_row(rng)
    adapted = pf.adapt(SKILL, task.scene_frames(scene))
    expected = []
    for mean, covariance in zip(adapted.means, adapted.covariances, strict=True):
        S, e = covariance + np.diag(NOISE**2), log_map(mean, x, STARTS)
        expected.append(-0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(S)[1]))
    given = situation(scene, task.random_scene(rng)).log_likelihoods(x)
    assert np.allclose(given - given[0], np.array(expected) - expected[0])


def test_sign_of_the_quaternion_does_not_matter(rng):
    scene, actual, x = task.random_scene(rng), task.random_scene(rng), random_row(rng)
    h = rng.dirichlet(np.ones(SKILL.states))
    mean, covariance = situation(scene, actual).correct(x, h)
    x[3:7] *= -1.0
    negated, same = situation(scene, actual).correct(x, h)
    assert angle(mean[3:7], negated[3:7]) < 1e-9
    assert np.allclose(mean[:3], negated[:3])
    assert np.allclose(covariance, same, atol=1e-12)


def test_mixture_has_the_mean_and_covariance_of_its_points(rng):
    points, h = rng.normal(size=(5, 3)), rng.dirichlet(np.ones(5))
    mean, between = mix_points(points, h, ())
    assert np.allclose(mean, h @ points)
    assert np.allclose(between, np.cov(points.T, aweights=h, bias=True))
