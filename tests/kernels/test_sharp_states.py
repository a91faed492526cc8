"""Sharp states: the recursions against 60-digit arithmetic, over deviations of 1e-3 to 1e-10 of a step."""

import itertools

import exact_chains
import mpmath
import numpy as np
import pytest
from exact_chains import DIGITS

from pilotfish.kernels import SemiMarkovTables

SHARPNESS = [10.0**-n for n in range(3, 11)]
RECORDINGS = ["plateaus", "outlier", "random", "mixed", "far"]
DURATIONS = ["uniform", "geometric", "gaussian", "bounded"]
RTOL = 1e-9  # of log-likelihoods
ATOL = 1e-6  # of posteriors: the best paths differ by rounding of log-emissions, some 1e-7 nats at most


def sample_recording(rng, kind, T, K, sharpness):
    """Return log-emissions of K scalar Gaussians of standard deviation about `sharpness` for T steps."""
    means, cuts = rng.normal(size=K), np.sort(rng.choice(np.arange(1, T), K - 1, replace=False))
    path = np.repeat(np.arange(K), np.diff([0, *cuts, T]))
    if kind == "mixed":
        path = rng.integers(K, size=T)
    x = rng.normal(size=T) if kind == "random" else means[path] + sharpness * rng.normal(size=T)
    if kind == "outlier":
        x[rng.integers(T)] += rng.normal()
    deviations = sharpness * rng.lognormal(sigma=0.5, size=K)
    log_emissions = -0.5 * (((x[:, None] - means) / deviations) ** 2 + np.log(2 * np.pi)) - np.log(deviations)
    if kind == "far":  # a step at up to 1e20 standard deviations from every state
        log_emissions[rng.integers(T)] -= 10.0 ** rng.integers(41)
    return log_emissions


def sample_durations(rng, kind, S, K, mean):
    """Return log-weights (4, S, K) of segments."""
    s = np.arange(1.0, S + 1)[:, None]
    if kind == "bounded":
        low, high = np.sort(rng.integers(1, S + 1, size=(2, K)), axis=0)
        weights = np.where((s >= low) & (s <= high), 0.0, -np.inf)
    else:
        weights = {"uniform": 0.0 * s, "geometric": -0.3 * s, "gaussian": -0.5 * ((s - mean) / 1.5) ** 2}[
            kind
        ]
    return np.broadcast_to(weights, (4, S, K)).copy()


def sample_chain(rng, K):
    """Return initial and transition probabilities without self-transitions: left-to-right, or any."""
    if rng.random() < 0.5:
        return np.eye(K)[0], np.eye(K, k=1)
    return rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K) * (1.0 - np.eye(K))


def sample_problem(rng, recording, durations, sharpness):
    T = int(rng.integers(2, 25))
    K, S = min(int(rng.integers(1, 4)), T), int(rng.integers(1, T + 3))
    tables = SemiMarkovTables(
        *sample_chain(rng, K),
        sample_durations(rng, durations, S, K, T / K),
        np.full((2, K), rng.choice([-np.inf, -3.0])),
    )
    return sample_recording(rng, recording, T, K, sharpness), tables


def assert_most_probable(log_emissions, log_weight, expected, actual):
    """Check that the path is as probable as the exact one; rounding may exchange equally probable paths."""
    states, log_probability = actual
    np.testing.assert_allclose(log_probability, expected.best_log_probability, rtol=RTOL, atol=RTOL)
    if expected.path and list(states) != expected.path:
        found, best = log_weight(states), log_weight(np.array(expected.path))
        steps = np.arange(len(log_emissions))
        with mpmath.workdps(DIGITS):
            found += sum(map(mpmath.mpf, log_emissions[steps, states]))
            best += sum(map(mpmath.mpf, log_emissions[steps, expected.path]))
            assert abs(found - best) < ATOL


def log_weight_of_markov_path(initial, transitions):
    def log_weight(path):
        return np.log(initial[path[0]]) + np.log(transitions[path[:-1], path[1:]]).sum()

    return log_weight


def log_weight_of_semi_markov_path(tables):
    def log_weight(path):
        cuts = [0, *(np.flatnonzero(np.diff(path)) + 1), len(path)]
        total = np.log(tables.initial[path[0]])
        for begin, end in itertools.pairwise(cuts):
            kind, s, k = 2 * (end == len(path)) + (begin == 0), end - begin, path[begin]
            max_duration = tables.log_segment_weights.shape[1]
            total += (
                tables.log_segment_weights[kind, s - 1, k]
                if s <= max_duration
                else tables.log_tail_weights[kind - 2, k]
            )
            total += np.log(tables.transitions[path[begin - 1], k]) if begin else 0.0
        return total

    return log_weight


@pytest.mark.parametrize("sharpness", SHARPNESS)
@pytest.mark.parametrize("durations", DURATIONS)
@pytest.mark.parametrize("recording", RECORDINGS)
def test_semi_markov_sharp_states_equals_60_digits(kernels, rng, recording, durations, sharpness):
    """Likelihood, posteriors, changes of state, forward variable and best path, at any sharpness."""
    log_emissions, tables = sample_problem(rng, recording, durations, sharpness)
    expected = exact_chains.semi_markov(log_emissions, tables)
    actual = kernels.semi_markov_forward_backward(log_emissions, tables)
    np.testing.assert_allclose(actual.log_likelihood, expected.log_likelihood, rtol=RTOL, atol=RTOL)
    np.testing.assert_allclose(actual.smoothed_state_probs, expected.smoothed_state_probs, atol=ATOL)
    np.testing.assert_allclose(actual.transition_counts, expected.transition_counts, atol=ATOL)
    forward = kernels.semi_markov_forward(log_emissions, tables)[1].max(axis=1)
    np.testing.assert_allclose(forward, expected.log_forward.max(axis=1), rtol=RTOL, atol=RTOL)
    best = kernels.semi_markov_viterbi(log_emissions, tables)
    assert_most_probable(log_emissions, log_weight_of_semi_markov_path(tables), expected, best)


@pytest.mark.parametrize("sharpness", SHARPNESS)
@pytest.mark.parametrize("recording", RECORDINGS)
def test_forward_backward_sharp_states_equals_60_digits(kernels, rng, recording, sharpness):
    """Likelihood, posteriors, transitions, forward variable and best path of a Markov chain."""
    for _ in range(4):
        T = int(rng.integers(2, 25))
        K = min(int(rng.integers(1, 5)), T)
        initial, transitions = sample_chain(rng, K)
        transitions = 0.7 * np.eye(K) + 0.3 * transitions
        log_emissions = sample_recording(rng, recording, T, K, sharpness)
        expected = exact_chains.markov(log_emissions, initial, transitions)
        actual = kernels.forward_backward(log_emissions, initial, transitions)
        np.testing.assert_allclose(actual.log_likelihood, expected.log_likelihood, rtol=RTOL, atol=RTOL)
        np.testing.assert_allclose(actual.smoothed_state_probs, expected.smoothed_state_probs, atol=ATOL)
        np.testing.assert_allclose(actual.transition_counts, expected.transition_counts, atol=ATOL)
        forward = actual.log_forward.max(axis=1)
        np.testing.assert_allclose(forward, expected.log_forward.max(axis=1), rtol=RTOL, atol=RTOL)
        best = kernels.viterbi(log_emissions, initial, transitions)
        with np.errstate(divide="ignore"):
            log_weight = log_weight_of_markov_path(initial, transitions)
            assert_most_probable(log_emissions, log_weight, expected, best)


@pytest.mark.parametrize("sharpness", [*SHARPNESS, 1e-12, 1e-15])
def test_semi_markov_three_plateaus_log_likelihood_equals_60_digits(kernels, rng, sharpness):
    """Near the end all mass lies in the last visit: starts of others are no point of reference."""
    T, K = 30, 3
    x = np.repeat(np.arange(K), T // K) + sharpness * rng.normal(size=T)
    log_emissions = -0.5 * ((x[:, None] - np.arange(K)) / sharpness) ** 2 - np.log(sharpness)
    tables = SemiMarkovTables(np.eye(K)[0], np.eye(K, k=1), np.zeros((4, T, K)), np.full((2, K), -np.inf))
    expected = exact_chains.semi_markov(log_emissions, tables)
    assert expected.log_likelihood > 100.0
    actual = kernels.semi_markov_forward_backward(log_emissions, tables).log_likelihood
    np.testing.assert_allclose(actual, expected.log_likelihood, rtol=1e-13)


@pytest.mark.parametrize("distance", [1e12, 1e16, 1e20, 1e100])
def test_e_step_step_far_from_all_states_mass_counts_every_step_once(kernels, case, distance):
    """An outlier at up to 1e50 standard deviations has posteriors that sum to one like any other step."""
    given = case(1, [20, 13], 2, 4)
    given.x[0, 5] += np.sqrt(2.0 * distance)
    sums = kernels.e_step(*given.arguments)
    np.testing.assert_allclose(sums.counts.sum(), 33.0, rtol=1e-12)
    np.testing.assert_allclose(sums.transition_counts.sum(), 33.0 - 2.0, rtol=1e-12)
    np.testing.assert_allclose(sums.initial_counts.sum(), 2.0, rtol=1e-12)
