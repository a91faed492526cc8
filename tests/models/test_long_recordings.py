"""Long recordings, and segments far longer than their distribution expects."""

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish import kernels
from pilotfish.demonstrations import Layout, Part, Quantity, demonstration, views
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import Censoring, HiddenModel, SemiMarkovChain, log_emissions, log_likelihood, viterbi
from pilotfish.models.durations import Gamma, Gaussian, Histogram, LogNormal
from pilotfish.models.semi_markov import FULL_LENGTH_FACTOR, TAIL_PROBABILITY

LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))
DISTRIBUTIONS = {
    "gaussian": Gaussian(np.array([4.0, 6.0, 5.0]), np.array([1.0, 0.5, 1.5])),
    "log-normal": LogNormal(np.log([4.0, 6.0, 5.0]), np.array([0.2, 0.1, 0.15])),
    "gamma": Gamma(np.array([8.0, 20.0, 9.0]), np.array([2.0, 4.0, 2.0])),
}


@pytest.fixture(params=DISTRIBUTIONS)
def model(request):
    """Return three states in a loop, four standard deviations apart."""
    chain = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), DISTRIBUTIONS[request.param])
    return HiddenModel(chain, np.array([[[0.0], [4.0], [8.0]]]), (DenseCovariances(np.ones((3, 1, 1))),))


def recording(states, rng):
    x = 4.0 * states[:, None] + rng.normal(size=(len(states), 1))
    return demonstration(x, 0.1, LAYOUT, (), "a recording")


def impossible_segment(model, rng, steps):
    """Return a state sequence with one segment ten times as long as expected."""
    states = model.dynamics.sample(steps, rng)
    begin = 1 + np.flatnonzero(np.diff(states))[len(states) // 20]
    return np.concatenate([states[:begin], np.full(60, states[begin]), states[begin:]])


@pytest.mark.parametrize("still", [False, True])
def test_extended_max_duration_equals_full_length(model, rng, still):
    """Likelihood, path, filtering and smoothing agree to 1e-8 nats per step."""
    model = replace(model, dynamics=replace(model.dynamics, censoring=Censoring.BOTH))
    T = 500
    demo = recording(impossible_segment(model, rng, T) if still else model.dynamics.sample(T, rng), rng)
    T, log_b = len(demo.x), log_emissions(model, views([demo]))
    assert FULL_LENGTH_FACTOR * model.dynamics.durations.max_duration(TAIL_PROBABILITY) < T
    tables = model.dynamics.segment_tables(T)
    full = kernels.semi_markov_forward_backward(log_b, tables)
    np.testing.assert_allclose(
        log_likelihood(model, [demo]), full.log_likelihood, rtol=0, atol=T * TAIL_PROBABILITY
    )
    np.testing.assert_array_equal(viterbi(model, demo), kernels.semi_markov_viterbi(log_b, tables)[0])
    np.testing.assert_allclose(
        model.dynamics.smoothed_state_probs(log_b), full.smoothed_state_probs, atol=2 * T * TAIL_PROBABILITY
    )
    filtered = kernels.semi_markov_forward(log_b, tables)[1]
    filtered = np.exp(filtered - logsumexp(filtered, axis=1, keepdims=True))
    np.testing.assert_allclose(
        model.dynamics.filtered_state_probs(log_b, T), filtered, atol=2 * T * TAIL_PROBABILITY
    )
    if still:  # the quantile of the distribution alone is not enough
        brief = model.dynamics.segment_tables(model.dynamics.durations.max_duration(TAIL_PROBABILITY))
        assert (
            kernels.semi_markov_forward_backward(log_b, brief).log_likelihood
            < full.log_likelihood - 100 * T * TAIL_PROBABILITY
        )


def test_filtered_state_probs_very_rare_duration_is_found(rng):
    """Each state lasts three steps, or 100 with probability 1e-12, and only 100 steps explain the data."""
    p = np.zeros((101, 2))
    p[2], p[99] = 1.0 - 1e-12, 1e-12
    chain = SemiMarkovChain(np.array([1.0, 0.0]), np.eye(2)[::-1], Histogram(p))
    log_b = np.zeros((120, 2))
    log_b[:100, 1] = -1e9
    log_b[100:, 0] = -1e9
    assert chain.durations.max_duration(TAIL_PROBABILITY) == 3
    filtered = chain.filtered_state_probs(log_b[:102], 102)
    np.testing.assert_allclose(filtered[:100, 0], 1.0)
    np.testing.assert_allclose(filtered[100:102, 1], 1.0)


def test_evaluate_100000_steps_takes_seconds(model):
    """The cost is linear in the number of steps."""
    rng = np.random.default_rng(0)
    states = model.dynamics.sample(100_000, rng)
    demo, begin = recording(states, rng), time.process_time()
    assert np.mean(viterbi(model, demo) == states) > 0.97
    actual = log_likelihood(model, [demo])
    log_b = log_emissions(model, views([demo]))
    filtered = model.dynamics.filtered_state_probs(log_b, len(log_b))
    np.testing.assert_allclose(filtered.sum(axis=1), 1.0)
    assert np.mean(filtered.argmax(axis=1) == states) > 0.95
    np.testing.assert_allclose(
        actual, log_likelihood(model, [demo], max_duration=200), atol=1e5 * TAIL_PROBABILITY
    )
    assert time.process_time() - begin < 20.0
