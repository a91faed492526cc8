"""A plan for moving objects is that for standing ones, its targets drawn evenly to where they will be."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import normalise
from pilotfish.models import AdaptedSkill, GaussianDurations, SemiMarkovChain
from pilotfish.planning import moving_frame_reference, reference_from_states

LAYOUTS = {
    "a place": Layout((Part("place", Quantity.SCALAR, 2, "m"),)),
    "a pose": pose_layout(),
    "a pose with speeds": pose_layout().differentiate(),
}
STATES = np.array([0, 0, 1, 1, 1, 2, 0])


def adapted(layout: Layout, rng: np.random.Generator) -> AdaptedSkill:
    """Three states somewhere, orientations of length one."""
    D = layout.width
    means, A = rng.normal(size=(3, D)), rng.normal(size=(3, D, D))
    for columns in layout.quaternions:
        means[:, columns] = normalise(means[:, columns])
    chain = SemiMarkovChain(np.eye(3)[0], np.eye(3, k=1), GaussianDurations(np.full(3, 4.0), np.ones(3)))
    covariances = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(D)
    return AdaptedSkill(chain, means, covariances, layout, 0.1)


def moved(skill: AdaptedSkill, rng: np.random.Generator) -> AdaptedSkill:
    """The same states a little elsewhere, each its own way, no quaternion on the other half of S^3."""
    return replace(skill, means=skill.means + 0.01 * rng.normal(size=skill.means.shape))


@pytest.mark.parametrize("name", LAYOUTS)
def test_where_nothing_moves_it_is_the_plan_for_what_stands(name: str, rng: np.random.Generator):
    """The same skill now and later gives the reference of its states, targets and weights."""
    skill = adapted(LAYOUTS[name], rng)
    made, expected = (
        moving_frame_reference(skill, skill, STATES, 1e-3),
        reference_from_states(skill, STATES, 1e-3),
    )
    np.testing.assert_allclose(made.targets, expected.targets, atol=1e-15)
    np.testing.assert_array_equal(made.weights, expected.weights)
    assert made.period == expected.period == 0.1


@pytest.mark.parametrize("name", LAYOUTS)
def test_targets_go_evenly_from_where_things_are_to_where_they_will_be(name: str, rng: np.random.Generator):
    """Step t of T has the share t / (T - 1) of its state's way: the first none of it, the last all."""
    now = adapted(LAYOUTS[name], rng)
    later = moved(now, rng)
    targets = moving_frame_reference(now, later, STATES, 1e-3).targets
    for t, k in enumerate(STATES):
        share = t / (len(STATES) - 1)
        np.testing.assert_allclose(
            targets[t], now.means[k] + share * (later.means[k] - now.means[k]), atol=1e-14
        )
    np.testing.assert_array_equal(targets[0], now.means[STATES[0]])
    np.testing.assert_array_equal(targets[-1], later.means[STATES[-1]])


def test_an_even_motion_of_everything_is_added_to_every_target(rng: np.random.Generator):
    """When all states move by d until the last step, each target is a standing one and its share of d."""
    now, d = adapted(LAYOUTS["a place"], rng), np.array([0.3, -0.2])
    targets = moving_frame_reference(now, replace(now, means=now.means + d), STATES, 0.0).targets
    steps = np.diff(targets - now.means[STATES], axis=0)
    np.testing.assert_allclose(steps, np.tile(d / (len(STATES) - 1), (len(STATES) - 1, 1)), atol=1e-14)


@pytest.mark.parametrize("name", ["a pose", "a pose with speeds"])
def test_signs_of_later_quaternions_do_not_matter(name: str, rng: np.random.Generator):
    """States whose q, and its speed with it, comes back as -q give the same plan: none goes through zero."""
    layout = LAYOUTS[name]
    now = adapted(layout, rng)
    later = moved(now, rng)
    turned = later.means.copy()
    quaternion = [n for n, label in enumerate(layout.names) if label.startswith("orientation")]
    turned[np.ix_([0, 2], quaternion)] *= -1.0
    one = moving_frame_reference(now, later, STATES, 1e-3)
    other = moving_frame_reference(now, replace(later, means=turned), STATES, 1e-3)
    np.testing.assert_allclose(one.targets, other.targets, atol=1e-15)
    lengths = np.linalg.norm(one.targets[:, 3:7], axis=1)
    assert lengths.min() > 0.95


def test_what_was_given_stays_as_it_was(rng: np.random.Generator):
    """Mending signs mends a copy."""
    now = adapted(LAYOUTS["a pose"], rng)
    later = replace(now, means=-now.means)
    kept = later.means.copy()
    moving_frame_reference(now, later, STATES, 1e-3)
    np.testing.assert_array_equal(later.means, kept)


def test_a_plan_of_one_step_is_where_things_are(rng: np.random.Generator):
    """There is no way yet."""
    now = adapted(LAYOUTS["a pose"], rng)
    targets = moving_frame_reference(now, moved(now, rng), np.array([1]), 1e-3).targets
    np.testing.assert_array_equal(targets, now.means[[1]])


def test_skills_that_are_not_the_same_are_refused(rng: np.random.Generator):
    """Another number of states, other columns of the same number, a slack that is no variance."""
    now = adapted(LAYOUTS["a place"], rng)
    fewer = replace(now, means=now.means[:2], covariances=now.covariances[:2])
    with pytest.raises(InvalidInput, match=r"\(3, 2\) and \(2, 2\), expected the same skill adapted twice"):
        moving_frame_reference(now, fewer, STATES, 1e-3)
    others = replace(now, layout=Layout((Part("angle", Quantity.SCALAR, 2, "rad"),)))
    with pytest.raises(InvalidInput, match=r"place 1.*angle 1.*expected the same skill adapted twice"):
        moving_frame_reference(now, others, STATES, 1e-3)
    with pytest.raises(InvalidInput, match="covariance_regularisation is -1"):
        moving_frame_reference(now, now, STATES, -1.0)
