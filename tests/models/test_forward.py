"""Forward variables, filtering, prediction and sampling of chains, against enumeration."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish.errors import InvalidInput
from pilotfish.models import MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.durations import Gaussian
from pilotfish.models.semi_markov import TAIL_PROBABILITY


def left_right(means, deviations):
    K = len(means)
    return SemiMarkovChain(
        np.eye(K)[0], np.eye(K, k=1), Gaussian(np.array(means, float), np.array(deviations, float))
    )


def random_chain(rng, K, final=False):
    A = rng.random((K, K)) * (1 - np.eye(K)) + 1e-3 * (1 - np.eye(K))
    if final:
        A[-1] = 0.0
    A = np.divide(A, A.sum(1, keepdims=True), out=np.zeros_like(A), where=A.sum(1, keepdims=True) > 0)
    durations = Gaussian(rng.uniform(0.5, 3.0, size=K), rng.uniform(0.3, 1.0, size=K))
    return SemiMarkovChain(rng.dirichlet(np.ones(K)), A, durations)


def enumerate_segmentations(chain, log_b):
    """Yield (whether the last segment ends, last state, log p) for every segmentation of the steps.

    The last segment ends with the last step or is right-censored; a final state never ends.
    """
    T, K = log_b.shape
    table = chain.durations.log_table(60)  # longer durations have negligible probability
    final = ~chain.transitions.any(axis=1)
    with np.errstate(divide="ignore"):
        log_initial, log_A = np.log(chain.initial), np.log(chain.transitions)
    for cuts in itertools.chain.from_iterable(itertools.combinations(range(1, T), n) for n in range(T)):
        begins, ends = (0, *cuts), (*cuts, T)
        lengths = [e - b for b, e in zip(begins, ends, strict=True)]
        for states in itertools.product(range(K), repeat=len(lengths)):
            if any(final[k] for k in states[:-1]):
                continue
            log_p = log_initial[states[0]] + sum(log_A[i, j] for i, j in itertools.pairwise(states))
            log_p += sum(table[d - 1, k] for d, k in zip(lengths[:-1], states[:-1], strict=True))
            log_p += sum(log_b[b:e, k].sum() for k, b, e in zip(states, begins, ends, strict=True))
            d, k = lengths[-1], states[-1]
            if final[k]:
                yield False, k, log_p
            else:
                yield True, k, log_p + table[d - 1, k]
                yield False, k, log_p + logsumexp(table[d:, k])


@pytest.mark.parametrize("brief", [False, True])
@pytest.mark.parametrize("final", [False, True])
def test_forward_variables_equal_enumeration_of_segmentations(rng, final, brief):
    """Also if segments are short and the final state lasts longer than the maximum duration."""
    T, K, observed = 6, 3, 1 if brief else 6
    chain, log_b = random_chain(rng, K, final), rng.normal(size=(T, K)) * 3
    log_b[observed:] = 0.0
    if brief:
        chain = replace(chain, durations=Gaussian(rng.uniform(1.0, 1.4, size=K), np.full(K, 0.1)))
        assert chain.durations.max_duration(TAIL_PROBABILITY) < T - 2
    log_segment_ends, log_forward = chain.forward(log_b[:observed], T)
    for t in range(1, T + 1):
        listed = list(enumerate_segmentations(chain, log_b[:t]))
        for k in range(K):
            ends = [p for e, state, p in listed if state == k and e]
            covers = [p for _, state, p in listed if state == k]
            expected = logsumexp(ends) if ends else -np.inf
            np.testing.assert_allclose(log_segment_ends[t - 1, k], expected, rtol=1e-9)
            np.testing.assert_allclose(log_forward[t - 1, k], logsumexp(covers), rtol=1e-9)


def test_forward_prediction_equals_zero_log_density(rng):
    """Steps beyond the observations are steps with a density of one in every state."""
    chain, log_b = random_chain(rng, 3), rng.normal(size=(2, 3))
    padded = np.vstack([log_b, np.zeros((3, 3))])
    np.testing.assert_allclose(
        chain.forward(log_b, 5)[1],
        chain.forward(padded, 5)[1],
    )


def test_filtered_state_probs_without_observations_sum_to_one(rng):
    """The probability of all states is one at every step, final states included."""
    for final in (False, True):
        _, log_forward = random_chain(rng, 4, final).forward(np.empty((0, 4)), 60)
        np.testing.assert_allclose(logsumexp(log_forward, axis=1), 0.0, atol=1e-9)


def test_forward_segment_from_first_step_is_included():
    """The printed recursion (3.40) omits it: with durations of exactly 3 steps, no segment would end."""
    chain = SemiMarkovChain(
        np.array([1.0, 0.0]), np.eye(2)[::-1], Gaussian(np.full(2, 3.0), np.full(2, 0.05))
    )
    ends = np.exp(chain.forward(np.empty((0, 2)), 6)[0])
    np.testing.assert_allclose(ends, [[0, 0], [0, 0], [1, 0], [0, 0], [0, 0], [0, 1]], atol=1e-12)


def test_gaussian_mean_below_one_lasts_one_step():
    """Durations are at least one step."""
    table = np.exp(Gaussian(np.array([-5.0, 0.2]), np.array([0.5, 0.1])).log_table(10))
    np.testing.assert_allclose(table.sum(axis=0), 1.0)
    assert (table[0] > 0.99).all()


def test_filtered_state_probs_markov_equals_bayes_rule(rng):
    K, T = 3, 7
    chain, log_b = (
        MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K)),
        rng.normal(size=(T, K)),
    )
    probs, rows = chain.initial, []
    for t in range(T):
        probs = probs * np.exp(log_b[t])
        probs = probs / probs.sum()
        rows.append(probs)
        probs = probs @ chain.transitions
    np.testing.assert_allclose(chain.filtered_state_probs(log_b, T), rows)
    np.testing.assert_allclose(
        chain.log_forward(log_b, T + 1)[-1],
        np.log(probs) + logsumexp(chain.log_forward(log_b, T)[-1]),
    )


def test_filtered_state_probs_do_not_underflow_over_100000_steps():
    chain = MarkovChain(np.array([1.0, 0.0]), np.array([[0.999, 0.001], [0.001, 0.999]]))
    log_b = np.full((100_000, 2), -5_000.0)
    np.testing.assert_allclose(chain.filtered_state_probs(log_b, 100_000)[-1], [0.5, 0.5], atol=1e-6)


def test_most_probable_states_left_right_keep_durations_and_stay_final():
    states = left_right([10, 20, 5], [1.0, 2.0, 1.0]).most_probable_states(np.empty((0, 3)), 80)
    assert abs(np.count_nonzero(states == 0) - 10) <= 1
    assert abs(np.count_nonzero(states == 1) - 20) <= 1
    assert (states[31:] == 2).all()


def test_observations_change_predicted_states():
    """An observation in the second state moves the first step there if it is possible."""
    chain = SemiMarkovChain(
        np.array([0.9, 0.1, 0.0]), np.eye(3, k=1), left_right([5, 5, 5], [1, 1, 1]).durations
    )
    assert chain.most_probable_states(np.array([[-1e4, 0.0, -1e4]]), 10)[0] == 1
    assert chain.most_probable_states(np.empty((0, 3)), 10)[0] == 0


@pytest.mark.usefixtures("unchecked")  # of 2000 calls
def test_sampled_state_frequencies_equal_filtered_state_probs(rng):
    chain, horizon, N = random_chain(rng, 3), 12, 2000
    counts = np.zeros((horizon, 3))
    for _ in range(N):
        counts[np.arange(horizon), chain.sample(horizon, rng)] += 1
    np.testing.assert_allclose(
        counts / N, chain.filtered_state_probs(np.empty((0, 3)), horizon), atol=5 * 0.5 / np.sqrt(N)
    )


@pytest.mark.usefixtures("unchecked")
def test_sampled_markov_state_frequencies_equal_filtered_state_probs(rng):
    chain, N = MarkovChain(np.array([0.7, 0.3]), np.array([[0.9, 0.1], [0.4, 0.6]])), 4000
    share = np.mean([chain.sample(5, rng)[-1] for _ in range(N)])
    assert abs(share - chain.filtered_state_probs(np.empty((0, 2)), 5)[-1, 1]) < 5 * 0.5 / np.sqrt(N)


@pytest.mark.usefixtures("unchecked")
def test_sample_branches_appear_with_their_probabilities(rng):
    chain = SemiMarkovChain(
        np.eye(3)[0],
        np.array([[0, 0.25, 0.75], [0, 0, 0], [0, 0, 0.0]]),
        Gaussian(np.full(3, 4.0), np.ones(3)),
    )
    ends = [chain.sample(20, rng)[-1] for _ in range(2000)]
    assert abs(np.mean(np.equal(ends, 2)) - 0.75) < 5 * np.sqrt(0.75 * 0.25 / 2000)


def test_sample_same_seed_gives_same_states():
    chain = left_right([4, 4], [2.0, 2.0])
    first, second = (chain.sample(30, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_invalid_observations_or_horizon_raise():
    chain = left_right([4, 4], [1, 1])
    with pytest.raises(InvalidInput, match="horizon is 0"):
        chain.filtered_state_probs(np.empty((0, 2)), 0)
    with pytest.raises(InvalidInput, match="horizon is 2, expected a whole number from 3"):
        chain.filtered_state_probs(np.zeros((3, 2)), 2)
    with pytest.raises(InvalidInput, match="observation 0 in state 0"):
        chain.filtered_state_probs(np.array([[-np.inf, 0.0]]), 2)
    with pytest.raises(InvalidInput, match="mixture"):
        MixtureWeights(np.ones(1)).filtered_state_probs(np.empty((0, 1)), 2)
    with pytest.raises(InvalidInput, match="horizon"):
        chain.sample(0, np.random.default_rng(0))


@pytest.mark.parametrize("shift", [2.0**30, 2.0**40])
def test_filtered_state_probs_are_invariant_to_common_log_likelihood(rng, shift):
    """An outlier far from every state, at one step or all, changes nothing."""
    chain, log_b = random_chain(rng, 3, final=True), rng.integers(-40, 0, size=(300, 3)) / 8.0
    expected = chain.filtered_state_probs(log_b, 320)
    outlier = log_b.copy()
    outlier[100] -= shift  # multiples of 1/8, so that subtraction is exact
    np.testing.assert_allclose(chain.filtered_state_probs(outlier, 320), expected, atol=1e-9)
    np.testing.assert_allclose(chain.filtered_state_probs(log_b - shift, 320), expected, atol=1e-9)


def test_filtered_state_probs_long_horizon_stay_in_final_state():
    p = left_right([5, 5, 5], [1, 1, 1]).filtered_state_probs(np.empty((0, 3)), 30_000)
    np.testing.assert_allclose(p[100:], np.broadcast_to([0, 0, 1.0], (29_900, 3)), atol=1e-9)
