"""Initialisation of expectation-maximisation, and dropped states."""

import numpy as np
import pytest

from pilotfish.demonstrations import Views, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments
from pilotfish.models import KMeans, MarkovChain, TimeBins
from pilotfish.models.initialisation import _count_distinct, _joint_features
from pilotfish.models.statistics import BLOCK_ROWS, labelled_statistics


def test_markov_fit_initial_probabilities_equal_first_states():
    """Three of four demonstrations begin in state 1."""
    data = Views(np.zeros((1, 8, 1)), np.full(4, 2))
    chain = MarkovChain.fit(labelled_statistics(data, np.array([1, 0, 1, 1, 0, 1, 1, 0]), 2))
    np.testing.assert_allclose(chain.initial, [0.25, 0.75])
    np.testing.assert_allclose(chain.transitions, [[0, 1], [2 / 3, 1 / 3]])


def test_drop_states_reroutes_transitions():
    """0 -> 1 -> 2 without state 1 is 0 -> 2."""
    data = Views(np.zeros((1, 9, 1)), np.array([9]))
    statistics = labelled_statistics(data, np.repeat([0, 1, 2], 3), 3)
    left = statistics.drop_states(np.array([False, True, False]))
    np.testing.assert_allclose(left.transitions, [[2, 1], [0, 2]])
    np.testing.assert_allclose(left.moments[0].counts, [3, 3])


@pytest.mark.parametrize("jitter", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("length", [4, 5, 9, 30])
def test_time_bins_are_ordered_and_not_empty(rng, jitter, length):
    """With any jitter, every state gets a step, in order of time."""
    data = Views(np.arange(length, dtype=float)[None, :, None], np.array([length]))
    statistics = TimeBins(jitter).initial_statistics(data, 4, rng)
    assert statistics.moments[0].counts.min() >= 1.0
    assert (np.diff(statistics.moments[0].means[:, 0]) > 0.0).all()
    np.testing.assert_array_equal(np.triu(np.tril(statistics.transitions, 1)), statistics.transitions)


def test_time_bins_with_boundaries_begin_at_them(rng):
    """Parts of 6 and 6, and of 4 and 8 steps: both have two of the four bins."""
    x = np.concatenate([np.arange(12.0), 100.0 + np.arange(12.0)])[None, :, None]
    data = Views(x, np.array([12, 12]))
    found = TimeBins(boundaries=((6,), (4,))).initial_statistics(data, 4, rng)
    labels = np.repeat([0, 1, 2, 3, 0, 1, 2, 3], [3, 3, 3, 3, 2, 2, 4, 4])
    expected = labelled_statistics(data, labels, 4)
    np.testing.assert_array_equal(found.moments[0].counts, expected.moments[0].counts)
    np.testing.assert_allclose(found.moments[0].means, expected.moments[0].means)
    np.testing.assert_array_equal(found.transitions, expected.transitions)


def test_time_bins_without_boundaries_in_between_equal_those_of_one_part(rng):
    """Boundaries at the cuts of the bins change nothing."""
    data = Views(rng.normal(size=(2, 24, 3)), np.array([12, 12]))
    plain = TimeBins().initial_statistics(data, 4, rng)
    cut = TimeBins(boundaries=((3, 6, 9), (3, 6, 9))).initial_statistics(data, 4, rng)
    np.testing.assert_allclose(cut.moments[1].means, plain.moments[1].means)


@pytest.mark.parametrize(
    ("boundaries", "message"),
    [
        (((4,),), "1 demonstrations, expected 2"),
        (((4,), (0,)), "demonstration 1 .* expected ascending steps from 1 to 11"),
        (((4,), (12,)), "ascending steps"),
        (((5, 4), (4, 5)), "demonstration 0"),
        (((1, 2, 3, 4), (1, 2, 3, 4)), "states is 4, expected 5 to 12"),
        (((11,), (1,)), "states is 4, expected 2 to 2 "),
    ],
)
def test_time_bins_boundaries_that_do_not_fit_are_refused(rng, boundaries, message):
    data = Views(np.zeros((1, 24, 1)), np.array([12, 12]))
    with pytest.raises(InvalidInput, match=message):
        TimeBins(boundaries=boundaries).initial_statistics(data, 4, rng)


def test_time_bins_boundaries_of_unequal_number_are_refused():
    with pytest.raises(InvalidInput, match="with 1 and with 2 steps"):
        TimeBins(boundaries=((1,), (2, 3)))


def test_k_means_every_transition_is_possible(rng, make_demonstrations):
    """Expectation-maximisation would keep a transition of probability zero at zero."""
    data = views(make_demonstrations(stops=4))
    chain = MarkovChain.fit(KMeans().initial_statistics(data, 4, rng))
    assert chain.transitions.min() > 0.0
    assert chain.initial.min() > 0.0


def test_k_means_is_invariant_to_units(rng, make_demonstrations):
    """A column in millimetres gives the same clusters as in metres."""
    data = views(make_demonstrations(stops=3, noise=0.02))
    scaled = Views(data.x * np.array([1.0, 1000.0]), data.lengths)
    masses = [
        np.sort(KMeans().initial_statistics(d, 3, np.random.default_rng(5)).moments[0].counts)
        for d in (data, scaled)
    ]
    np.testing.assert_allclose(masses[0], masses[1])


@pytest.mark.parametrize("N", [1, 5, BLOCK_ROWS, 3 * BLOCK_ROWS + 7])
def test_labelled_statistics_of_blocks_equal_all_at_once(rng, N):
    """A label without points has count zero."""
    labels, x = rng.integers(0, 3, size=N), 1e3 + rng.normal(size=(2, N, 3))
    statistics = labelled_statistics(Views(x, np.array([N])), labels, 4)
    for actual, view in zip(statistics.moments, x, strict=True):
        expected = Moments.from_data(view, np.eye(4)[labels])
        np.testing.assert_array_equal(actual.counts, expected.counts)
        np.testing.assert_allclose(actual.means, expected.means, rtol=1e-12)
        np.testing.assert_allclose(actual.scatter_matrices, expected.scatter_matrices, rtol=1e-9, atol=1e-9)


def test_joint_features_have_unit_variance(rng):
    """A constant column is not scaled."""
    x = rng.normal(size=(2, 50, 3)) * np.array([1e-3, 1.0, 1e3])
    x[1, :, 2] = 4.0
    joint = _joint_features(Views(x, np.array([20, 30])))
    side_by_side = np.concatenate(list(x), axis=1)
    np.testing.assert_allclose(
        joint[:, :5], side_by_side[:, :5] / side_by_side[:, :5].std(axis=0), rtol=1e-12
    )
    np.testing.assert_array_equal(joint[:, 5], 4.0)


@pytest.mark.parametrize("different", [1, 3, 6])
def test_count_distinct_repeated_points_equals_number_of_distinct(rng, different):
    """The last distinct point may come after any number of repetitions."""
    x = np.zeros((2 * BLOCK_ROWS + 50, 2))
    x[rng.choice(len(x), different - 1, replace=False)] = np.arange(1.0, different)[:, None]
    assert _count_distinct(x, 6) == different
    assert _count_distinct(x, 2) == min(different, 2)
