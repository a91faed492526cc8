"""Shared control by equations 6.4-6.9: regression per frame and product, against sampling."""

from dataclasses import replace

import assisted_task as task
import numpy as np
import pytest

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance.literal import literal_situation
from pilotfish.demonstrations import Demonstration, Layout, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, log_density, product
from pilotfish.models import EMSettings, TimeBins


def positions(demo: Demonstration) -> Demonstration:
    """Return the positions of a demonstration only, in R^3."""
    layout = Layout(demo.layout.parts[:1])
    frames = [replace(f, A=f.A[:3, :3], b=f.b[:3]) for f in demo.frames]
    return demonstration(demo.x[:, :3], demo.period, layout, frames, demo.name)


def joint_of_positions() -> pf.Skill:
    demos = [assistance.joint_demonstration(positions(demo)) for demo in task.demonstrations()]
    in_order = {"initialisation": TimeBins(complete=True), "settings": EMSettings(min_gain=0.5)}
    return pf.learn(demos, states=4, rng=np.random.default_rng(0), **in_order).skill


def sampled_regression(rng, skill, frame, p, h, x) -> Gaussian:
    """Return mean and covariance of the output given the input, from samples of each state."""
    A, b = frame.A[:3, :3], frame.b[:3]
    means, covariances = [], []
    for mean, covariance in zip(skill.means[p], skill.covariances[p].dense, strict=True):
        samples = rng.multivariate_normal(mean, covariance, size=1_600_000)
        inputs, outputs = samples[:, :3], samples[:, 3:] @ A.T + b
        design = np.column_stack([np.ones(len(inputs)), inputs - x])
        fitted = np.linalg.solve(design.T @ design, design.T @ outputs)  # least squares
        means.append(fitted[0])
        residuals = outputs - design @ fitted
        covariances.append(residuals.T @ residuals / len(residuals))
    mean = h @ np.array(means)
    spread = np.array(means) - mean
    total = np.einsum("k,kij->ij", h, np.array(covariances)) + (h[:, None] * spread).T @ spread
    return Gaussian(mean, total)


def test_regression_and_product_agree_with_samples(rng):
    skill, h = joint_of_positions(), rng.dirichlet(np.ones(4))
    frames = [replace(f, A=f.A[:3, :3], b=f.b[:3]) for f in task.scene_frames(task.random_scene(rng))]
    x = skill.means[0, 2, :3] + 0.01 * rng.normal(size=3)
    parts = [sampled_regression(rng, skill, frame, p, h, x) for p, frame in enumerate(frames)]
    expected = product(parts)
    mean, covariance = literal_situation(skill, frames).correct(x, h)
    deviation = np.sqrt(np.trace(expected.covariance))
    assert np.abs(mean - expected.mean).max() < 0.02 * deviation
    assert np.abs(covariance - expected.covariance).max() < 0.02 * np.trace(expected.covariance)


def test_one_input_marginal_is_counted(rng):
    skill = joint_of_positions()
    frames = [replace(f, A=f.A[:3, :3], b=f.b[:3]) for f in task.scene_frames(task.random_scene(rng))]
    x = skill.means[0, 1, :3] + 0.02 * rng.normal(size=3)
    expected = [
        log_density(Gaussian(mean[:3], S[:3, :3]), x[None])[0]
        for mean, S in zip(skill.means[0], skill.covariances[0].dense, strict=True)
    ]
    assert np.allclose(literal_situation(skill, frames).log_likelihoods(x), expected)


def test_input_part_is_the_same_in_all_frames_and_output_part_is_local():
    demo = task.demonstrations()[0]
    joint = assistance.joint_demonstration(demo)
    assert joint.layout.names[:3] == ("operator position x", "operator position y", "operator position z")
    for frame, own in zip(joint.frames, demo.frames, strict=True):
        local = frame.to_local(joint.x)
        assert np.allclose(local[:, :7], joint.x[:, :7])
        assert np.allclose(local[:, 7:10], own.to_local(demo.x)[:, :3])


def test_skill_of_other_columns_is_refused_as_joint_skill():
    with pytest.raises(InvalidInput, match="learn it from joint_demonstration"):
        assistance.assisted_skill(task.learn(), joint_skill=task.learn("sphere"))


def test_joint_skill_of_other_frames_is_refused():
    other = replace(task.learn("joint"), frame_names=("cube", "door"))
    with pytest.raises(InvalidInput, match="expected those of the skill"):
        assistance.assisted_skill(task.learn(), joint_skill=other)


def test_missing_frame_is_named(rng):
    frames = task.scene_frames(task.random_scene(rng))[:1]
    with pytest.raises(InvalidInput, match="'tray' is missing"):
        literal_situation(task.learn("joint"), frames)
