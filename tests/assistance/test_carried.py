"""Carrying a command from the frames observed to the actual frames, and fusing it with the model."""

import assisted_task as task
import numpy as np
import pytest

import pilotfish as pf
from pilotfish.assistance.carried import carried_situation, carry_maps
from pilotfish.assistance.coordinates import coordinate_skill
from pilotfish.assistance.operator_noise import OperatorNoise
from pilotfish.gaussians import Gaussian, product
from pilotfish.geometry import angle, exp_map, log_map, rotation_matrix
from pilotfish.kernels.reference.assistance import command_log_likelihoods, correct_command, mix_points

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
    C, c = carry_maps(SKILL, frames, frames)
    assert np.allclose(C, np.eye(3), atol=1e-12)
    assert np.allclose(c, 0.0, atol=1e-12)


def test_command_moves_with_all_objects_together(rng):
    scene, motion = task.random_scene(rng), task.rigid_motion(rng)
    moved = tuple(motion @ pose for pose in scene)
    x, h = random_row(rng), rng.dirichlet(np.ones(SKILL.states))
    still, _ = correct_command(situation(scene, scene), x, h)
    carried, _ = correct_command(situation(scene, moved), x, h)
    expected = task.move_row(motion, still)
    assert np.allclose(carried[:3], expected[:3], atol=1e-9)
    assert angle(carried[3:7], expected[3:7]) < 1e-9


def test_mean_orientation_and_grip_of_a_state_are_carried_to_its_own(rng):
    scene, actual = task.random_scene(rng), task.random_scene(rng)
    observed, adapted = (pf.adapt(SKILL, task.scene_frames(s)) for s in (scene, actual))
    carried = carried_situation(
        SKILL, task.scene_frames(scene), task.scene_frames(actual), np.full(7, 1e-5)
    )  # of an operator who is precise
    for k in range(SKILL.states):
        x = observed.means[k].copy()
        x[:3] = task.random_scene(rng)[0].position
        mean, _ = correct_command(carried, x, one_hot(k))
        assert np.allclose(log_map(adapted.means[k], mean, STARTS)[3:], 0.0, atol=1e-5)


def test_carried_position_minimises_the_weighted_distance_to_that_of_each_object(rng):
    scene, moved = (task.random_scene(rng) for _ in range(2))
    frames, actual = task.scene_frames(scene), task.scene_frames(moved)
    x = rng.normal(size=3)
    C, c = carry_maps(SKILL, frames, actual)
    for k in range(SKILL.states):
        rows, values = [], []
        for p, (before, after) in enumerate(zip(scene, moved, strict=True)):
            rotation = rotation_matrix(after.quaternion)
            local = SKILL.covariances[p].dense[k][:3, :3]
            root = np.linalg.inv(np.linalg.cholesky(rotation @ local @ rotation.T))
            seen = rotation_matrix(before.quaternion).T @ (x - before.position)  # from the object
            rows.append(root)
            values.append(root @ (rotation @ seen + after.position))
        expected = np.linalg.lstsq(np.vstack(rows), np.concatenate(values))[0]
        assert np.allclose(C[k] @ x + c[k], expected)


def test_fusion_is_the_product_of_model_and_operator(rng):
    scene, actual, k = task.random_scene(rng), task.random_scene(rng), 3
    observed, adapted = (pf.adapt(SKILL, task.scene_frames(s)) for s in (scene, actual))
    x = exp_map(observed.means[k], 0.03 * rng.normal(size=7), STARTS)
    C, c = carry_maps(SKILL, task.scene_frames(scene), task.scene_frames(actual))
    d = log_map(observed.means[k], x, STARTS)
    d[:3] = C[k] @ x[:3] + c[k] - adapted.means[k, :3]
    fused = product([Gaussian(np.zeros(7), adapted.covariances[k]), Gaussian(d, np.diag(NOISE**2))])
    mean, covariance = correct_command(situation(scene, actual), x, one_hot(k))
    assert np.allclose(log_map(adapted.means[k], mean, STARTS), fused.mean, atol=1e-9)
    assert np.allclose(covariance, fused.covariance, atol=1e-12)


@pytest.mark.parametrize(("deviation", "share"), [(1e-5, 1.0), (1e2, 0.0)])
def test_precise_operator_is_followed_and_imprecise_one_corrected(rng, deviation, share):
    scene, k = task.random_scene(rng), 3
    adapted = pf.adapt(SKILL, task.scene_frames(scene))
    e = 0.02 * rng.normal(size=7)
    x = exp_map(adapted.means[k], e, STARTS)
    mean, _ = correct_command(situation(scene, scene, np.full(7, deviation)), x, one_hot(k))
    assert np.allclose(log_map(adapted.means[k], mean, STARTS), share * e, atol=1e-3)


def test_density_of_a_command_is_that_of_model_and_noise_together(rng):
    scene, x = task.random_scene(rng), random_row(rng)
    adapted = pf.adapt(SKILL, task.scene_frames(scene))
    expected = []
    for mean, covariance in zip(adapted.means, adapted.covariances, strict=True):
        S, e = covariance + np.diag(NOISE**2), log_map(mean, x, STARTS)
        expected.append(-0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(S)[1]))
    given = command_log_likelihoods(situation(scene, task.random_scene(rng)), x)
    assert np.allclose(given - given[0], np.array(expected) - expected[0])


def test_sign_of_the_quaternion_does_not_matter(rng):
    scene, actual, x = task.random_scene(rng), task.random_scene(rng), random_row(rng)
    h = rng.dirichlet(np.ones(SKILL.states))
    mean, covariance = correct_command(situation(scene, actual), x, h)
    x[3:7] *= -1.0
    negated, same = correct_command(situation(scene, actual), x, h)
    assert angle(mean[3:7], negated[3:7]) < 1e-9
    assert np.allclose(mean[:3], negated[:3])
    assert np.allclose(covariance, same, atol=1e-12)


def test_mixture_has_the_mean_and_covariance_of_its_points(rng):
    points, h = rng.normal(size=(5, 3)), rng.dirichlet(np.ones(5))
    mean, between = mix_points(points, h, is_oriented=False)
    assert np.allclose(mean, h @ points)
    assert np.allclose(between, np.cov(points.T, aweights=h, bias=True))
