"""Chains short enough to list every path, and chains so long or so unlikely that floating point gives out."""

import itertools

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish.kernels import reference

SHORT = [(1, 1), (1, 3), (2, 2), (5, 3), (4, 4), (7, 2)]


def ignore_log_of_zero():
    return np.errstate(divide="ignore")


def enumerate_paths(log_emissions, initial, transitions):
    """Return every path (N, T) and log p(emissions, path) (N,)."""
    T, K = log_emissions.shape
    every = np.array(list(itertools.product(range(K), repeat=T)))
    with ignore_log_of_zero():
        log_p = np.log(initial)[every[:, 0]] + log_emissions[np.arange(T), every].sum(axis=1)
        log_p += np.log(transitions)[every[:, :-1], every[:, 1:]].sum(axis=1)
    return every, log_p


@pytest.mark.parametrize("zeros", [0.0, 0.5])
@pytest.mark.parametrize("spread", [1.0, 5000.0])
@pytest.mark.parametrize(("T", "K"), SHORT)
def test_forward_backward_equals_enumeration(kernels, chain, T, K, spread, zeros):
    """Likelihood, state probabilities, transitions and forward variable are sums over all paths.

    At the larger spread, emissions of neighbouring states differ by thousands of nats; at the larger fraction
    of zeros, half of the transitions are impossible.
    """
    problem = chain(T, K, spread, zeros)
    every, log_p = enumerate_paths(*problem)
    result = kernels.forward_backward(*problem)
    log_likelihood = logsumexp(log_p) if np.isfinite(log_p).any() else -np.inf
    np.testing.assert_allclose(result.log_likelihood, log_likelihood, rtol=1e-12)
    share = np.exp(log_p - log_likelihood) if np.isfinite(log_likelihood) else np.zeros(len(log_p))
    for k in range(K):
        np.testing.assert_allclose(
            result.smoothed_state_probs[:, k], share @ (every == k), rtol=1e-8, atol=1e-11
        )
        for j in range(K):
            steps = ((every[:, :-1] == j) & (every[:, 1:] == k)).sum(axis=1)
            np.testing.assert_allclose(result.transition_counts[j, k], share @ steps, rtol=1e-8, atol=1e-11)
    for t in range(T):
        heads, log_heads = enumerate_paths(problem[0][: t + 1], *problem[1:])
        for k in range(K):
            expected = np.logaddexp.reduce(log_heads[heads[:, -1] == k])
            np.testing.assert_allclose(result.log_forward[t, k], expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("zeros", [0.0, 0.3])
@pytest.mark.parametrize("spread", [1.0, 5000.0])
@pytest.mark.parametrize(("T", "K"), SHORT)
def test_viterbi_equals_enumeration(kernels, chain, T, K, spread, zeros):
    """The path is the most probable of all, and log_probability is its own."""
    problem = chain(T, K, spread, zeros)
    every, log_p = enumerate_paths(*problem)
    states, log_probability = kernels.viterbi(*problem)
    np.testing.assert_allclose(log_probability, log_p.max(), rtol=1e-12)
    if np.isfinite(log_p.max()):
        np.testing.assert_array_equal(states, every[log_p.argmax()])


def test_viterbi_tie_takes_lower_state(kernels, rng):
    """Among equally probable paths, the one whose last differing state has the lower index is returned.

    Integer emissions and certain transitions make ties exact.
    """
    log_emissions = rng.integers(0, 2, size=(6, 3)).astype(float)
    every, log_p = enumerate_paths(log_emissions, np.ones(3), np.ones((3, 3)))
    best = min(every[log_p == log_p.max()].tolist(), key=lambda path: path[::-1])
    assert kernels.viterbi(log_emissions, np.ones(3), np.ones((3, 3)))[0].tolist() == best


def test_forward_backward_no_possible_path_is_zero(kernels):
    """Log-likelihood -inf, probabilities and transitions zero, nothing undefined: at the start and later."""
    dead_end = np.array([[0.0, 1.0], [0.0, 0.0]])
    for log_emissions, initial in [
        (np.zeros((3, 2)), np.array([1.0, 0.0])),  # two steps lead nowhere
        (np.full((2, 2), -np.inf), np.array([0.5, 0.5])),
        (np.zeros((1, 2)), np.zeros(2)),
    ]:
        result = kernels.forward_backward(log_emissions, initial, dead_end)
        assert result.log_likelihood == -np.inf
        assert not result.smoothed_state_probs.any()
        assert not result.transition_counts.any()
        assert not np.isnan(result.log_forward).any()
        assert kernels.viterbi(log_emissions, initial, dead_end)[1] == -np.inf


def test_forward_backward_impossible_emission_forbids_its_state(kernels):
    """With -inf at one state, the paths through the others remain."""
    log_emissions = np.array([[0.0, 0.0], [-np.inf, 0.0], [0.0, 0.0]])
    result = kernels.forward_backward(log_emissions, np.array([0.5, 0.5]), np.full((2, 2), 0.5))
    np.testing.assert_allclose(result.smoothed_state_probs, [[0.5, 0.5], [0.0, 1.0], [0.5, 0.5]])
    np.testing.assert_allclose(result.log_likelihood, np.log(0.5))


@pytest.mark.parametrize("rare", [1e-12, 1e-200, 1e-310])
def test_forward_backward_path_far_beyond_underflow_is_found(kernels, rare):
    """State 1 is 1e-4000 times less likely at every early step, and the only one that can end.

    The path to it has probability `rare` at each step, down to subnormal numbers.
    """
    T, turn = 40, 25
    log_emissions = np.zeros((T, 2))
    log_emissions[:turn, 1], log_emissions[turn:, 0] = -9000.0, -1e6
    transitions = np.array([[1.0, rare], [0.0, 1.0]])  # rows need not sum to one
    result = kernels.forward_backward(log_emissions, np.array([1.0, 0.0]), transitions)
    np.testing.assert_allclose(result.log_likelihood, np.log(rare), rtol=1e-12)  # change exactly at the turn
    np.testing.assert_allclose(result.transition_counts[0, 1], 1.0, rtol=1e-9)
    assert kernels.viterbi(log_emissions, np.array([1.0, 0.0]), transitions)[0].sum() == T - turn


@pytest.mark.parametrize("rng", [0], indirect=True)
@pytest.mark.parametrize("spread", [1.0, 3000.0])
def test_forward_backward_hundred_thousand_steps_equals_reference(compiled, chain, spread):
    """State probabilities sum to one at every step, and transitions sum to the number of steps.

    Log-probabilities of the reference reach 2e8, where the rounding error of every step is 1e-8.
    """
    problem = chain(100_000, 3, spread, zeros=0.2)
    result, reference_result = compiled.forward_backward(*problem), reference.forward_backward(*problem)
    assert np.isfinite(result.log_likelihood)
    np.testing.assert_allclose(result.log_likelihood, reference_result.log_likelihood, rtol=1e-11)
    np.testing.assert_allclose(result.smoothed_state_probs.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(result.transition_counts.sum(), 99_999, rtol=1e-12)
    np.testing.assert_allclose(
        result.transition_counts.sum(axis=1), result.smoothed_state_probs[:-1].sum(axis=0), rtol=1e-9
    )
    np.testing.assert_allclose(result.smoothed_state_probs, reference_result.smoothed_state_probs, atol=1e-6)
    np.testing.assert_allclose(result.log_forward, reference_result.log_forward, rtol=1e-11)
    states, _ = compiled.viterbi(*problem)
    np.testing.assert_array_equal(states, reference.viterbi(*problem)[0])


@pytest.mark.parametrize("zeros", [0.0, 0.6])
@pytest.mark.parametrize("spread", [1.0, 700.0])
@pytest.mark.parametrize("K", [1, 2, 7, 8, 9, 16, 17, 30])
def test_forward_backward_compiled_equals_reference(compiled, chain, K, spread, zeros):
    """Any number of states, also near the multiples of eight to which the kernel pads them."""
    problem = chain(50, K, spread, zeros)
    result, reference_result = compiled.forward_backward(*problem), reference.forward_backward(*problem)
    np.testing.assert_allclose(result.log_likelihood, reference_result.log_likelihood, rtol=1e-12)
    np.testing.assert_allclose(result.log_forward, reference_result.log_forward, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        result.smoothed_state_probs, reference_result.smoothed_state_probs, rtol=1e-7, atol=1e-30
    )
    np.testing.assert_allclose(
        result.transition_counts, reference_result.transition_counts, rtol=1e-7, atol=1e-25
    )
    found, expected = compiled.viterbi(*problem), reference.viterbi(*problem)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-13)
    np.testing.assert_array_equal(found[0], expected[0])
