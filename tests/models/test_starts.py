"""Beginnings of a fit: what is counted, what stays possible, and what must not matter."""

import numpy as np
import pytest

from pilotfish.demonstrations import Views, views
from pilotfish.models import KMeans, TimeBins, labelled_statistics, most_likely_chain
from pilotfish.models.em import without


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
