"""Durations of the states of a plan."""

import numpy as np
import pytest

from pilotfish.models import state_segments
from pilotfish.models.durations import Gaussian
from pilotfish.planning.timing import share_time


def conditional_mean(means: np.ndarray, deviations: np.ndarray, total: int) -> np.ndarray:
    """Return the mean of independent Gaussian entries given their sum, from their joint covariance."""
    n = len(means)
    joint = np.vstack([np.eye(n), np.ones(n)])
    covariance = joint @ np.diag(deviations**2) @ joint.T
    return means + covariance[:n, n] / covariance[n, n] * (total - means.sum())


@pytest.mark.parametrize("total", [40, 63, 90])
def test_share_time_segments_begin_within_half_a_step_of_conditional_mean(rng, total):
    means, deviations = rng.uniform(5.0, 12.0, size=8), rng.uniform(1.0, 3.0, size=8)
    order = np.array([3, 0, 5, 1, 7, 2])
    expected = conditional_mean(means[order], deviations[order], total)
    assert (expected > 1.0).all()
    states = np.repeat(order, np.diff([0, 2, 3, 5, 9, 20, total]))
    found, lengths = state_segments(share_time(states, Gaussian(means, deviations)))
    np.testing.assert_array_equal(found, order)
    assert np.abs(np.cumsum(lengths) - np.cumsum(expected)).max() <= 0.5
    assert lengths.sum() == total


def test_share_time_equal_states_of_half_steps_are_never_late_by_a_step():
    """Thirty states of 3.5 steps: a sequence of 15 states of 3 and 15 of 4 is late by 7.5 in the middle."""
    states = np.repeat(np.arange(30), [3] * 15 + [4] * 15)
    shared = share_time(states, Gaussian(np.full(30, 3.5), np.ones(30)))
    starts = np.searchsorted(shared, np.arange(30))
    assert np.abs(starts - 3.5 * np.arange(30)).max() <= 0.5


@pytest.mark.parametrize("total", [4, 5, 9])
def test_share_time_fast_plan_keeps_a_step_for_every_state(total):
    """Four states of 1, 30, 1 and 60 steps in a few steps."""
    states = np.repeat(np.arange(4), [1, 1, 1, total - 3])
    shared = share_time(states, Gaussian(np.array([1.0, 30.0, 1.0, 60.0]), np.array([0.1, 9.0, 0.1, 30.0])))
    found, lengths = state_segments(shared)
    np.testing.assert_array_equal(found, np.arange(4))
    assert lengths.min() >= 1
    assert len(shared) == total


def test_share_time_one_state_takes_all_steps():
    states = np.zeros(5, dtype=np.int64)
    np.testing.assert_array_equal(share_time(states, Gaussian(np.array([3.0]), np.array([1.0]))), states)
