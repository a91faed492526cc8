"""Beginnings of a fit: what is counted, what stays possible, and what must not matter."""

import numpy as np
import pytest

from pilotfish.demonstrations import Views, views
from pilotfish.gaussians import moments
from pilotfish.models import KMeans, TimeBins, labelled_statistics, most_likely_chain
from pilotfish.models.em import without
from pilotfish.models.starts import _distinct, _joint_view
from pilotfish.models.statistics import BLOCK


def test_a_chain_begins_where_demonstrations_begin():
    """Three of four demonstrations begin in state 1: so does the skill, with probability 3/4."""
    data = Views(np.zeros((1, 8, 1)), np.full(4, 2))
    chain = most_likely_chain(labelled_statistics(data, np.array([1, 0, 1, 1, 0, 1, 1, 0]), 2))
    np.testing.assert_allclose(chain.initial, [0.25, 0.75])
    np.testing.assert_allclose(chain.transitions, [[0, 1], [2 / 3, 1 / 3]])


def test_steps_through_a_state_that_is_gone_lead_to_where_it_led():
    """0 -> 1 -> 2 without 1 is 0 -> 2: a left-right skill stays whole."""
    data = Views(np.zeros((1, 9, 1)), np.array([9]))
    sums = labelled_statistics(data, np.repeat([0, 1, 2], 3), 3)
    left = without(sums, np.array([False, True, False]))
    np.testing.assert_allclose(left.transitions, [[2, 1], [0, 2]])
    np.testing.assert_allclose(left.moments[0].mass, [3, 3])


@pytest.mark.parametrize("jitter", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("length", [4, 5, 9, 30])
def test_time_bins_are_in_order_and_none_is_empty(rng, jitter, length):
    """Whatever the jitter, every state gets a step and states follow each other."""
    data = Views(np.arange(length, dtype=float)[None, :, None], np.array([length]))
    sums = TimeBins(jitter).guess(data, 4, rng)
    assert sums.moments[0].mass.min() >= 1.0
    assert (np.diff(sums.moments[0].means[:, 0]) > 0.0).all()
    np.testing.assert_array_equal(np.triu(np.tril(sums.transitions, 1)), sums.transitions)


def test_after_k_means_any_state_may_follow_any_other(rng, scene):
    """Expectation-maximisation cannot revive a transition of probability zero; k-means forbids none."""
    data = views(scene(stops=4))
    chain = most_likely_chain(KMeans().guess(data, 4, rng))
    assert chain.transitions.min() > 0.0
    assert chain.initial.min() > 0.0


def test_k_means_does_not_depend_on_the_units_of_a_column(rng, scene):
    """Millimetres beside metres give the same clusters."""
    data = views(scene(stops=3, noise=0.02))
    scaled = Views(data.x * np.array([1.0, 1000.0]), data.lengths)
    masses = [np.sort(KMeans().guess(d, 3, np.random.default_rng(5)).moments[0].mass) for d in (data, scaled)]
    np.testing.assert_allclose(masses[0], masses[1])


@pytest.mark.parametrize("N", [1, 5, BLOCK, 3 * BLOCK + 7])
def test_known_states_are_counted_block_by_block_as_all_at_once(rng, N):
    """Every point belongs to its label alone, however many points there are; a label without any has none."""
    labels, x = rng.integers(0, 3, size=N), 1e3 + rng.normal(size=(2, N, 3))
    sums = labelled_statistics(Views(x, np.array([N])), labels, 4)
    for told, view in zip(sums.moments, x, strict=True):
        whole = moments(view, np.eye(4)[labels])
        np.testing.assert_array_equal(told.mass, whole.mass)
        np.testing.assert_allclose(told.means, whole.means, rtol=1e-12)
        np.testing.assert_allclose(told.scatters, whole.scatters, rtol=1e-9, atol=1e-9)


def test_views_stand_side_by_side_each_column_of_unit_variance(rng):
    """A column that never changes stays as it is."""
    x = rng.normal(size=(2, 50, 3)) * np.array([1e-3, 1.0, 1e3])
    x[1, :, 2] = 4.0
    joint = _joint_view(Views(x, np.array([20, 30])))
    side_by_side = np.concatenate(list(x), axis=1)
    np.testing.assert_allclose(
        joint[:, :5], side_by_side[:, :5] / side_by_side[:, :5].std(axis=0), rtol=1e-12
    )
    np.testing.assert_array_equal(joint[:, 5], 4.0)


@pytest.mark.parametrize("different", [1, 3, 6])
def test_different_points_are_counted_wherever_they_stand(rng, different):
    """The last of them may come after any number of repetitions."""
    x = np.zeros((2 * BLOCK + 50, 2))
    x[rng.choice(len(x), different - 1, replace=False)] = np.arange(1.0, different)[:, None]
    assert _distinct(x, 6) == different
    assert _distinct(x, 2) == min(different, 2)
