"""Visits followed as far as matters: recordings of any length, and visits far longer than expected."""

import time
from dataclasses import replace

import numpy as np
import pytest
from pilotfish.models.segments import FULL_LENGTH_FACTOR, TAIL_PROBABILITY, segment_tables
from scipy.special import logsumexp

from pilotfish import kernels
from pilotfish.demonstrations import Layout, Part, Quantity, demonstration, views
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import (
    Censoring,
    GammaDurations,
    GaussianDurations,
    HiddenModel,
    HistogramDurations,
    LogNormalDurations,
    SemiMarkovChain,
    filtered_state_probs,
    log_emissions,
    log_likelihood,
    sample_states,
    smoothed_state_probs,
    viterbi,
)

PLACE = Layout((Part("place", Quantity.SCALAR, 1, "m"),))
DISTRIBUTIONS = {
    "gaussian": GaussianDurations(np.array([4.0, 6.0, 5.0]), np.array([1.0, 0.5, 1.5])),
    "log-normal": LogNormalDurations(np.log([4.0, 6.0, 5.0]), np.array([0.2, 0.1, 0.15])),
    "gamma": GammaDurations(np.array([8.0, 20.0, 9.0]), np.array([2.0, 4.0, 2.0])),
}


@pytest.fixture(params=DISTRIBUTIONS)
def model(request):
    """Three states in a row and round again, at places apart by four deviations."""
    chain = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), DISTRIBUTIONS[request.param])
    return HiddenModel(chain, np.array([[[0.0], [4.0], [8.0]]]), (DenseCovariances(np.ones((3, 1, 1))),))


def recording(states, rng):
    x = 4.0 * states[:, None] + rng.normal(size=(len(states), 1))
    return demonstration(x, 0.1, PLACE, (), "a recording")


def impossible_segment(model, rng, steps):
    """A recording that stands still in the middle for ten times as long as any visit is expected to."""
    states = sample_states(model.dynamics, steps, rng)
    begin = 1 + np.flatnonzero(np.diff(states))[len(states) // 20]
    return np.concatenate([states[:begin], np.full(60, states[begin]), states[begin:]])


@pytest.mark.parametrize("still", [False, True])
def test_extended_max_duration_equals_full_length(model, rng, still):
    """Likelihood, path, filtering and smoothing: to 1e-8 nats a step, also where a visit is far too long."""
    model = replace(model, dynamics=replace(model.dynamics, censoring=Censoring(left=True)))
    T = 500
    demo = recording(
        impossible_segment(model, rng, T) if still else sample_states(model.dynamics, T, rng), rng
    )
    T, log_b = len(demo.x), log_emissions(model, views([demo]))
    assert FULL_LENGTH_FACTOR * model.dynamics.durations.max_duration(TAIL_PROBABILITY) < T
    tables = segment_tables(model.dynamics, T)
    full = kernels.semi_markov_forward_backward(log_b, tables)
    np.testing.assert_allclose(
        log_likelihood(model, [demo]), full.log_likelihood, rtol=0, atol=T * TAIL_PROBABILITY
    )
    np.testing.assert_array_equal(viterbi(model, demo), kernels.semi_markov_viterbi(log_b, tables).states)
    np.testing.assert_allclose(
        smoothed_state_probs(model.dynamics, log_b), full.smoothed_state_probs, atol=2 * T * TAIL_PROBABILITY
    )
    filtered = kernels.semi_markov_forward(log_b, tables).log_forward
    filtered = np.exp(filtered - logsumexp(filtered, axis=1, keepdims=True))
    np.testing.assert_allclose(
        filtered_state_probs(model.dynamics, log_b, T), filtered, atol=2 * T * TAIL_PROBABILITY
    )
    if still:  # and the law alone would not do
        brief = segment_tables(model.dynamics, model.dynamics.durations.max_duration(TAIL_PROBABILITY))
        assert (
            kernels.semi_markov_forward_backward(log_b, brief).log_likelihood
            < full.log_likelihood - 100 * T * TAIL_PROBABILITY
        )


def test_data_that_are_impossible_without_a_long_visit_are_possible(rng):
    """Two states, each visited for exactly three steps but seldom a hundred, and a recording of one visit.

    A hundred steps are rarer than what is followed at first, and nothing shorter explains the second state.
    """
    p = np.zeros((101, 2))
    p[2], p[99] = 1.0 - 1e-12, 1e-12
    chain = SemiMarkovChain(np.array([1.0, 0.0]), np.eye(2)[::-1], HistogramDurations(p))
    log_b = np.zeros((120, 2))
    log_b[:100, 1] = -1e9
    log_b[100:, 0] = -1e9
    assert chain.durations.max_duration(TAIL_PROBABILITY) == 3
    filtered = filtered_state_probs(chain, log_b[:102], 102)
    np.testing.assert_allclose(filtered[:100, 0], 1.0)
    np.testing.assert_allclose(filtered[100:102, 1], 1.0)


def test_a_hundred_thousand_steps_take_seconds(model):
    """Linear in their number: states come back, and halves are no more likely than the whole."""
    rng = np.random.default_rng(0)
    states = sample_states(model.dynamics, 100_000, rng)
    demo, begin = recording(states, rng), time.process_time()
    assert np.mean(viterbi(model, demo) == states) > 0.97
    found = log_likelihood(model, [demo])
    log_b = log_emissions(model, views([demo]))
    filtered = filtered_state_probs(model.dynamics, log_b, len(log_b))
    np.testing.assert_allclose(filtered.sum(axis=1), 1.0)
    assert np.mean(filtered.argmax(axis=1) == states) > 0.95
    np.testing.assert_allclose(
        found, log_likelihood(model, [demo], max_duration=200), atol=1e5 * TAIL_PROBABILITY
    )
    assert time.process_time() - begin < 20.0
