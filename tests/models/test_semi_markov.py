"""Semi-Markov models: E-step, Viterbi path and log-likelihood by enumeration; sampling."""

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish.demonstrations import Layout, Part, Quantity, Views, demonstration, views
from pilotfish.gaussians.structures import DenseCovariances, Full
from pilotfish.models import (
    Censoring,
    DurationModel,
    HiddenModel,
    MarkovChain,
    SemiMarkovChain,
    expected_statistics,
    log_emissions,
    log_likelihood,
    maximise_likelihood,
    viterbi,
)
from pilotfish.models.durations import (
    DISTRIBUTIONS,
    Gamma,
    Gaussian,
    Histogram,
    LogNormal,
    NegativeBinomial,
    Poisson,
)

LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))


def make_durations(rng, K, kind):
    match kind:
        case "gaussian":
            return Gaussian(rng.uniform(1.0, 4.0, K), rng.uniform(0.5, 2.0, K))
        case "log-normal":
            return LogNormal(rng.uniform(0.2, 1.5, K), rng.uniform(0.2, 0.6, K))
        case "gamma":
            return Gamma(rng.uniform(1.0, 6.0, K), rng.uniform(1.0, 2.0, K))
        case "poisson":
            return Poisson(rng.uniform(0.5, 3.0, K))
        case "negative-binomial":
            return NegativeBinomial(rng.uniform(0.5, 4.0, K), rng.uniform(0.4, 0.8, K))
    return Histogram(rng.dirichlet(np.ones(4), size=K).T)


KINDS = list(DISTRIBUTIONS)


def random_model(rng, K=3, kind="gaussian", censoring=Censoring.RIGHT, final=True, P=1, D=1):
    A = rng.random((K, K)) * (1 - np.eye(K)) + 1e-3 * (1 - np.eye(K))
    A = A / np.maximum(A.sum(axis=1, keepdims=True), 1e-300)
    if final:
        A[-1] = 0.0
    chain = SemiMarkovChain(rng.dirichlet(np.ones(K)), A, make_durations(rng, K, kind), censoring)
    spread = np.broadcast_to(np.eye(D), (P, K, D, D)).copy()
    return HiddenModel(chain, 2 * rng.normal(size=(P, K, D)), tuple(DenseCovariances(c) for c in spread))


def enumerate_segmentations(chain, log_b):
    """Yield (states, lengths, log p) of every segmentation of the recording, by definition."""
    T, K = log_b.shape
    N = 400
    p = np.exp(chain.durations.log_table(N))
    longer = np.cumsum(p[::-1], axis=0)[::-1]
    excess = np.cumsum(longer[::-1], axis=0)[::-1]
    mean = np.arange(1, N + 1) @ p
    first, last = chain.censoring.left, chain.censoring.right
    final = ~chain.transitions.any(axis=1)

    def weight(k, d, begins, ends):
        if ends and last and final[k]:
            return 1.0
        if begins and first:
            return (excess if ends and last else longer)[d - 1, k] / mean[k]
        return (longer if ends and last else p)[d - 1, k]

    for cuts in itertools.chain.from_iterable(itertools.combinations(range(1, T), n) for n in range(T)):
        begins, ends = (0, *cuts), (*cuts, T)
        lengths = [e - b for b, e in zip(begins, ends, strict=True)]
        for states in itertools.product(range(K), repeat=len(lengths)):
            if any(final[k] for k in states[:-1]):
                continue
            prior = chain.initial[states[0]]
            prior *= np.prod([chain.transitions[i, j] for i, j in itertools.pairwise(states)])
            for k, b, e in zip(states, begins, ends, strict=True):
                prior *= weight(k, e - b, b == 0, e == T)
            if prior > 0.0:
                recorded = sum(log_b[b:e, k].sum() for k, b, e in zip(states, begins, ends, strict=True))
                yield states, lengths, np.log(prior) + recorded


@pytest.mark.parametrize("censoring", Censoring)
@pytest.mark.parametrize("kind", KINDS)
def test_expected_statistics_equal_enumeration_of_segmentations(rng, kind, censoring):
    """Likelihood, first states, transitions, counts and segments of every kind of censoring."""
    K, T = 3, 5
    model, x = random_model(rng, K, kind, censoring), 2 * rng.normal(size=(1, T, 1))
    data = Views(x, np.array([T]))
    listed = list(enumerate_segmentations(model.dynamics, log_emissions(model, data)))
    log_p = np.array([p for _, _, p in listed])
    statistics = expected_statistics(model, data, max_duration=T)
    np.testing.assert_allclose(statistics.log_likelihood, logsumexp(log_p), rtol=1e-8)
    initial_counts, pairs, counts, segments = np.zeros(K), np.zeros((K, K)), np.zeros(K), np.zeros((4, T, K))
    final = ~model.dynamics.transitions.any(axis=1)
    for (states, lengths, _), share in zip(listed, np.exp(log_p - logsumexp(log_p)), strict=True):
        initial_counts[states[0]] += share
        np.add.at(pairs, (list(states[:-1]), list(states[1:])), share)
        np.add.at(counts, list(states), share * np.array(lengths))
        for n, (k, d) in enumerate(zip(states, lengths, strict=True)):
            ended = n == len(states) - 1 and censoring.right
            begun = n == 0 and censoring.left
            if not (ended and final[k]):
                segments[2 * begun + ended, d - 1, k] += share
    np.testing.assert_allclose(statistics.initial_counts, initial_counts, atol=1e-8)
    np.testing.assert_allclose(statistics.transitions, pairs, atol=1e-8)
    np.testing.assert_allclose(statistics.moments[0].counts, counts, atol=1e-8)
    for actual, expected in zip(fields(statistics.segments), segments, strict=True):
        np.testing.assert_allclose(getattr(statistics.segments, actual.name), expected, atol=1e-8)


@pytest.mark.parametrize("censoring", Censoring)
def test_viterbi_equals_most_probable_of_all_segmentations(rng, censoring):
    model = random_model(rng, 3, "gamma", censoring)
    x = 2 * rng.normal(size=(5, 1))
    demo = demonstration(x, 0.1, LAYOUT, (), "five steps")
    listed = list(enumerate_segmentations(model.dynamics, log_emissions(model, views([demo]))))
    states, lengths, _ = max(listed, key=lambda one: one[2])
    np.testing.assert_array_equal(viterbi(model, demo), np.repeat(states, lengths))


@pytest.mark.parametrize("censoring", [Censoring.RIGHT, Censoring.BOTH])
@pytest.mark.parametrize("kind", KINDS)
def test_log_likelihood_equals_forward_recursion(rng, kind, censoring):
    """The E-step and the forward recursion are two algorithms; the last state is summed out."""
    model = random_model(rng, 3, kind, censoring, final=False)
    demos = [demonstration(rng.normal(size=(T, 1)), 0.1, LAYOUT, (), f"{T}") for T in (2, 4, 30)]
    actual = log_likelihood(model, demos)
    for value, demo in zip(actual, demos, strict=True):
        log_b = log_emissions(model, views([demo]))
        _, log_forward = model.dynamics.forward(log_b, len(log_b))
        np.testing.assert_allclose(value, logsumexp(log_forward[-1]), rtol=1e-9)


def geometric_model(rng, K):
    exit_probs = rng.uniform(0.1, 0.6, K)
    transitions = rng.random((K, K)) * (1 - np.eye(K))
    transitions /= transitions.sum(axis=1, keepdims=True)
    initial = rng.dirichlet(np.ones(K))
    steps = np.diag(1 - exit_probs) + exit_probs[:, None] * transitions
    durations = NegativeBinomial(np.ones(K), exit_probs)
    return SemiMarkovChain(initial, transitions, durations), MarkovChain(initial, steps)


def test_geometric_durations_equal_markov_model(rng):
    """The same likelihood, and one M-step leads to the same model."""
    semi, markov = geometric_model(rng, 3)
    emissions = random_model(rng, 3, D=2)
    data = Views(rng.normal(size=(1, 70, 2)), np.array([30, 40]))
    a, b = replace(emissions, dynamics=semi), replace(emissions, dynamics=markov)
    exact, plain = expected_statistics(a, data, max_duration=40), expected_statistics(b, data)
    np.testing.assert_allclose(exact.log_likelihood, plain.log_likelihood)
    np.testing.assert_allclose(
        exact.moments[0].scatter_matrices, plain.moments[0].scatter_matrices, atol=1e-8
    )

    def chain(statistics, previous):
        duration_model = DurationModel(NegativeBinomial, options={"shape": 1.0})
        return SemiMarkovChain.fit(statistics, previous, duration_model=duration_model, min_variance=1.0)

    new = maximise_likelihood(exact, a, Full(), 0.0, chain).dynamics
    old = maximise_likelihood(plain, b, Full(), 0.0, MarkovChain.fit).dynamics
    np.testing.assert_allclose(new.initial, old.initial)
    np.testing.assert_allclose(new.durations.exit_probs, 1.0 - np.diag(old.transitions), rtol=1e-6)
    onward = new.durations.exit_probs[:, None] * new.transitions
    np.testing.assert_allclose(onward, old.transitions * (1 - np.eye(3)), rtol=1e-6)
    np.testing.assert_allclose(MarkovChain.fit(exact).transitions, old.transitions, rtol=1e-7)


def test_statistics_of_parts_sum_to_statistics_of_all(rng, make_demonstrations):
    """Segments included."""
    demos = make_demonstrations(lengths=(12, 20, 17, 31), frames=1)
    model = random_model(rng, 3, "gamma", D=2, P=1)
    whole = expected_statistics(model, views(demos))
    parts = expected_statistics(model, views(demos[2:])) + expected_statistics(model, views(demos[:2]))
    np.testing.assert_allclose(parts.log_likelihood, whole.log_likelihood)
    np.testing.assert_allclose(parts.transitions, whole.transitions, atol=1e-9)
    for f in fields(whole.segments):
        np.testing.assert_allclose(
            getattr(parts.segments, f.name), getattr(whole.segments, f.name), atol=1e-7
        )


@pytest.mark.parametrize("censoring", [Censoring.RIGHT, Censoring.BOTH])
@pytest.mark.parametrize("kind", KINDS)
def test_sampled_state_frequencies_equal_filtered_state_probs(kind, censoring):
    """For every distribution, with and without left-censoring."""
    rng = np.random.default_rng(5)
    chain, horizon, N = random_model(rng, 3, kind, censoring).dynamics, 8, 500
    counts = np.zeros((horizon, 3))
    for _ in range(N):
        counts[np.arange(horizon), chain.sample(horizon, rng)] += 1
    expected = chain.filtered_state_probs(np.empty((0, 3)), horizon)
    np.testing.assert_allclose(expected.sum(axis=1), 1.0)
    np.testing.assert_allclose(counts / N, expected, atol=5 * 0.5 / np.sqrt(N))


def test_left_censored_chain_is_stationary():
    """Two states in turn, with initial probabilities equal to their shares of time."""
    durations = Gamma(np.array([4.0, 9.0]), np.array([0.5, 0.5]))
    shares = durations.means / durations.means.sum()
    chain = SemiMarkovChain(shares, np.eye(2)[::-1], durations, Censoring.BOTH)
    np.testing.assert_allclose(
        chain.filtered_state_probs(np.empty((0, 2)), 60), np.tile(shares, (60, 1)), atol=1e-9
    )
