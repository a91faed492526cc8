"""Plans for moving objects: targets are interpolated from now to later."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import normalise
from pilotfish.models import AdaptedSkill, SemiMarkovChain
from pilotfish.models.durations import Gaussian as GaussianDurations
from pilotfish.planning.moving import moving_frame_reference
from pilotfish.planning.plan import reference_from_states

LAYOUTS = {
    "position": Layout((Part("place", Quantity.SCALAR, 2, "m"),)),
    "pose": pose_layout(),
    "pose with velocities": pose_layout().differentiate(),
}
STATES = np.array([0, 0, 1, 1, 1, 2, 0])


def random_skill(layout: Layout, rng: np.random.Generator) -> AdaptedSkill:
    """Return three random states with unit quaternions."""
    D = layout.width
    means, A = rng.normal(size=(3, D)), rng.normal(size=(3, D, D))
    for columns in layout.quaternions:
        means[:, columns] = normalise(means[:, columns])
    chain = SemiMarkovChain(np.eye(3)[0], np.eye(3, k=1), GaussianDurations(np.full(3, 4.0), np.ones(3)))
    covariances = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(D)
    return AdaptedSkill(chain, means, covariances, layout, 0.1)


def displace(skill: AdaptedSkill, rng: np.random.Generator) -> AdaptedSkill:
    """Return the same states with small random displacements, no quaternion negated."""
    return replace(skill, means=skill.means + 0.01 * rng.normal(size=skill.means.shape))


@pytest.mark.parametrize("name", LAYOUTS)
def test_moving_frame_reference_static_objects_equals_reference_from_states(
    name: str, rng: np.random.Generator
):
    """The same skill now and later gives the reference of its states."""
    skill = random_skill(LAYOUTS[name], rng)
    found, expected = (
        moving_frame_reference(skill, skill, STATES, 1e-3),
        reference_from_states(skill, STATES, 1e-3),
    )
    np.testing.assert_allclose(found.targets, expected.targets, atol=1e-15)
    np.testing.assert_array_equal(found.weights, expected.weights)
    assert found.period == expected.period == 0.1


@pytest.mark.parametrize("name", LAYOUTS)
def test_moving_frame_reference_targets_are_interpolated(name: str, rng: np.random.Generator):
    """Step t of T has the fraction t / (T - 1) of the displacement of its state."""
    now = random_skill(LAYOUTS[name], rng)
    later = displace(now, rng)
    targets = moving_frame_reference(now, later, STATES, 1e-3).targets
    for t, k in enumerate(STATES):
        fraction = t / (len(STATES) - 1)
        np.testing.assert_allclose(
            targets[t], now.means[k] + fraction * (later.means[k] - now.means[k]), atol=1e-14
        )
    np.testing.assert_array_equal(targets[0], now.means[STATES[0]])
    np.testing.assert_array_equal(targets[-1], later.means[STATES[-1]])


def test_moving_frame_reference_common_translation_is_added(rng: np.random.Generator):
    """If all states move by d, each target moves by its fraction of d."""
    now, d = random_skill(LAYOUTS["position"], rng), np.array([0.3, -0.2])
    targets = moving_frame_reference(now, replace(now, means=now.means + d), STATES, 0.0).targets
    steps = np.diff(targets - now.means[STATES], axis=0)
    np.testing.assert_allclose(steps, np.tile(d / (len(STATES) - 1), (len(STATES) - 1, 1)), atol=1e-14)


@pytest.mark.parametrize("name", ["pose", "pose with velocities"])
def test_moving_frame_reference_is_independent_of_quaternion_signs(name: str, rng: np.random.Generator):
    """A later state with -q, and its negated velocity, gives the same plan."""
    layout = LAYOUTS[name]
    now = random_skill(layout, rng)
    later = displace(now, rng)
    negated = later.means.copy()
    quaternion = [n for n, label in enumerate(layout.names) if label.startswith("orientation")]
    negated[np.ix_([0, 2], quaternion)] *= -1.0
    expected = moving_frame_reference(now, later, STATES, 1e-3)
    found = moving_frame_reference(now, replace(later, means=negated), STATES, 1e-3)
    np.testing.assert_allclose(found.targets, expected.targets, atol=1e-15)
    lengths = np.linalg.norm(found.targets[:, 3:7], axis=1)
    assert lengths.min() > 0.95


def test_moving_frame_reference_leaves_arguments_unchanged(rng: np.random.Generator):
    """Signs are aligned in a copy."""
    now = random_skill(LAYOUTS["pose"], rng)
    later = replace(now, means=-now.means)
    original = later.means.copy()
    moving_frame_reference(now, later, STATES, 1e-3)
    np.testing.assert_array_equal(later.means, original)


def test_moving_frame_reference_one_step_equals_mean(rng: np.random.Generator):
    """A single step has the mean of now."""
    now = random_skill(LAYOUTS["pose"], rng)
    targets = moving_frame_reference(now, displace(now, rng), np.array([1]), 1e-3).targets
    np.testing.assert_array_equal(targets, now.means[[1]])


def test_moving_frame_reference_different_skills_are_refused(rng: np.random.Generator):
    """Other states, other columns and a negative regularisation are refused."""
    now = random_skill(LAYOUTS["position"], rng)
    fewer = replace(now, means=now.means[:2], covariances=now.covariances[:2])
    with pytest.raises(InvalidInput, match=r"\(3, 2\) and \(2, 2\), expected the same skill adapted twice"):
        moving_frame_reference(now, fewer, STATES, 1e-3)
    renamed = replace(now, layout=Layout((Part("angle", Quantity.SCALAR, 2, "rad"),)))
    with pytest.raises(InvalidInput, match=r"place 1.*angle 1.*expected the same skill adapted twice"):
        moving_frame_reference(now, renamed, STATES, 1e-3)
    with pytest.raises(InvalidInput, match="covariance_regularisation is -1"):
        moving_frame_reference(now, now, STATES, -1.0)
