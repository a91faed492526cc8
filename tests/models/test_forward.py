"""Recursions of semi-Markov and Markov chains, against listing every segmentation."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from pilotfish.models.segments import TAIL_PROBABILITY
from scipy.special import logsumexp

from pilotfish.errors import InvalidInput
from pilotfish.models import (
    GaussianDurations,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
    filtered_state_probs,
    markov_forward,
    most_probable_states,
    sample_states,
    semi_markov_forward,
)


def left_right(means, deviations):
    K = len(means)
    return SemiMarkovChain(
        np.eye(K)[0], np.eye(K, k=1), GaussianDurations(np.array(means, float), np.array(deviations, float))
    )


def random_chain(rng, K, final=False):
    A = rng.random((K, K)) * (1 - np.eye(K)) + 1e-3 * (1 - np.eye(K))
    if final:
        A[-1] = 0.0
    A = np.divide(A, A.sum(1, keepdims=True), out=np.zeros_like(A), where=A.sum(1, keepdims=True) > 0)
    durations = GaussianDurations(rng.uniform(0.5, 3.0, size=K), rng.uniform(0.3, 1.0, size=K))
    return SemiMarkovChain(rng.dirichlet(np.ones(K)), A, durations)


def enumerate_segmentations(chain, log_b):
    """(ends at the last step?, last state, log p) for every way to cover the steps with visits.

    The last visit may end with the last step or go on beyond it; a final state only goes on.
    """
    T, K = log_b.shape
    table = chain.durations.log_table(60)  # no visit of these chains lasts longer
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
def test_forward_variable_and_occupancy_agree_with_listing_every_segmentation(rng, final, brief):
    """Also when visits are brief, so that a final state is expected beyond the longest of the others."""
    T, K, observed = 6, 3, 1 if brief else 6
    chain, log_b = random_chain(rng, K, final), rng.normal(size=(T, K)) * 3
    log_b[observed:] = 0.0
    if brief:
        chain = replace(chain, durations=GaussianDurations(rng.uniform(1.0, 1.4, size=K), np.full(K, 0.1)))
        assert chain.durations.max_duration(TAIL_PROBABILITY) < T - 2
    forward = semi_markov_forward(chain, log_b[:observed], T)
    for t in range(1, T + 1):
        listed = list(enumerate_segmentations(chain, log_b[:t]))
        for k in range(K):
            ends = [p for e, state, p in listed if state == k and e]
            covers = [p for _, state, p in listed if state == k]
            expected = logsumexp(ends) if ends else -np.inf
            np.testing.assert_allclose(forward.log_segment_ends[t - 1, k], expected, rtol=1e-9)
            np.testing.assert_allclose(forward.log_forward[t - 1, k], logsumexp(covers), rtol=1e-9)


def test_prediction_counts_transitions_and_durations_only(rng):
    """Beyond the observations nothing speaks for a state: the same as emissions of probability one."""
    chain, log_b = random_chain(rng, 3), rng.normal(size=(2, 3))
    padded = np.vstack([log_b, np.zeros((3, 3))])
    np.testing.assert_allclose(
        semi_markov_forward(chain, log_b, 5).log_forward,
        semi_markov_forward(chain, padded, 5).log_forward,
    )


def test_filtered_state_probs_without_observations_sum_to_one(rng):
    """At every step the skill is somewhere: no probability leaks, final states included."""
    for final in (False, True):
        forward = semi_markov_forward(random_chain(rng, 4, final), np.empty((0, 4)), 60)
        np.testing.assert_allclose(logsumexp(forward.log_forward, axis=1), 0.0, atol=1e-9)


def test_segments_that_begin_at_the_first_step_are_counted():
    """The printed recursion (3.40) forgets them: with one state of exact duration 3 it would end nowhere."""
    chain = SemiMarkovChain(
        np.array([1.0, 0.0]), np.eye(2)[::-1], GaussianDurations(np.full(2, 3.0), np.full(2, 0.05))
    )
    ends = np.exp(semi_markov_forward(chain, np.empty((0, 2)), 6).log_segment_ends)
    np.testing.assert_allclose(ends, [[0, 0], [0, 0], [1, 0], [0, 0], [0, 0], [0, 1]], atol=1e-12)


def test_segments_last_at_least_one_step():
    """A mean below one step is cut to one step, never to none."""
    table = np.exp(GaussianDurations(np.array([-5.0, 0.2]), np.array([0.5, 0.1])).log_table(10))
    np.testing.assert_allclose(table.sum(axis=0), 1.0)
    assert (table[0] > 0.99).all()


def test_filtering_a_markov_chain_is_bayes_rule_step_by_step(rng):
    K, T = 3, 7
    chain, log_b = (
        MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K)),
        rng.normal(size=(T, K)),
    )
    belief, rows = chain.initial, []
    for t in range(T):
        belief = belief * np.exp(log_b[t])
        belief = belief / belief.sum()
        rows.append(belief)
        belief = belief @ chain.transitions
    np.testing.assert_allclose(filtered_state_probs(chain, log_b, T), rows)
    np.testing.assert_allclose(
        markov_forward(chain, log_b, T + 1)[-1],
        np.log(belief) + logsumexp(markov_forward(chain, log_b, T)[-1]),
    )


def test_filtered_state_probs_do_not_underflow_over_100000_steps():
    chain = MarkovChain(np.array([1.0, 0.0]), np.array([[0.999, 0.001], [0.001, 0.999]]))
    log_b = np.full((100_000, 2), -5_000.0)
    np.testing.assert_allclose(filtered_state_probs(chain, log_b, 100_000)[-1], [0.5, 0.5], atol=1e-6)


def test_a_left_right_skill_goes_through_its_states_in_time_and_stays_at_the_end():
    states = most_probable_states(left_right([10, 20, 5], [1.0, 2.0, 1.0]), np.empty((0, 3)), 80)
    assert abs(np.count_nonzero(states == 0) - 10) <= 1
    assert abs(np.count_nonzero(states == 1) - 20) <= 1
    assert (states[31:] == 2).all()


def test_observations_change_predicted_states():
    """A first observation in the second state begins there, if the chain may begin there."""
    chain = SemiMarkovChain(
        np.array([0.9, 0.1, 0.0]), np.eye(3, k=1), left_right([5, 5, 5], [1, 1, 1]).durations
    )
    assert most_probable_states(chain, np.array([[-1e4, 0.0, -1e4]]), 10)[0] == 1
    assert most_probable_states(chain, np.empty((0, 3)), 10)[0] == 0


@pytest.mark.usefixtures("unchecked")  # of 4000 calls
def test_sampled_state_frequencies_equal_filtered_state_probs(rng):
    chain, horizon, N = random_chain(rng, 3), 12, 4000
    counts = np.zeros((horizon, 3))
    for _ in range(N):
        counts[np.arange(horizon), sample_states(chain, horizon, rng)] += 1
    np.testing.assert_allclose(
        counts / N, filtered_state_probs(chain, np.empty((0, 3)), horizon), atol=5 * 0.5 / np.sqrt(N)
    )


@pytest.mark.usefixtures("unchecked")
def test_sampled_markov_state_frequencies_equal_filtered_state_probs(rng):
    chain, N = MarkovChain(np.array([0.7, 0.3]), np.array([[0.9, 0.1], [0.4, 0.6]])), 4000
    share = np.mean([sample_states(chain, 5, rng)[-1] for _ in range(N)])
    assert abs(share - filtered_state_probs(chain, np.empty((0, 2)), 5)[-1, 1]) < 5 * 0.5 / np.sqrt(N)


@pytest.mark.usefixtures("unchecked")
def test_several_ways_through_a_movement_appear_with_their_probabilities(rng):
    chain = SemiMarkovChain(
        np.eye(3)[0],
        np.array([[0, 0.25, 0.75], [0, 0, 0], [0, 0, 0.0]]),
        GaussianDurations(np.full(3, 4.0), np.ones(3)),
    )
    ends = [sample_states(chain, 20, rng)[-1] for _ in range(2000)]
    assert abs(np.mean(np.equal(ends, 2)) - 0.75) < 5 * np.sqrt(0.75 * 0.25 / 2000)


def test_a_seed_repeats_a_sample():
    chain = left_right([4, 4], [2.0, 2.0])
    one, two = (sample_states(chain, 30, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_invalid_arguments_raise():
    chain = left_right([4, 4], [1, 1])
    with pytest.raises(InvalidInput, match="horizon is 0"):
        filtered_state_probs(chain, np.empty((0, 2)), 0)
    with pytest.raises(InvalidInput, match="horizon is 2, expected a whole number from 3"):
        filtered_state_probs(chain, np.zeros((3, 2)), 2)
    with pytest.raises(InvalidInput, match="observation 0 in state 0"):
        filtered_state_probs(chain, np.array([[-np.inf, 0.0]]), 2)
    with pytest.raises(InvalidInput, match="mixture"):
        filtered_state_probs(MixtureWeights(np.ones(1)), np.empty((0, 1)), 2)
    with pytest.raises(InvalidInput, match="horizon"):
        sample_states(chain, 0, np.random.default_rng(0))


@pytest.mark.parametrize("shift", [2.0**30, 2.0**40])
def test_filtered_state_probs_are_invariant_to_common_log_likelihood(rng, shift):
    """An outlier far from every state, at one step or at all, leaves the occupancy as it is."""
    chain, log_b = random_chain(rng, 3, final=True), rng.integers(-40, 0, size=(300, 3)) / 8.0
    expected = filtered_state_probs(chain, log_b, 320)
    outlier = log_b.copy()
    outlier[100] -= shift  # eighths: nothing of log_b is rounded away
    np.testing.assert_allclose(filtered_state_probs(chain, outlier, 320), expected, atol=1e-9)
    np.testing.assert_allclose(filtered_state_probs(chain, log_b - shift, 320), expected, atol=1e-9)


def test_final_state_is_kept_over_long_horizon():
    """Linear in the horizon: what has settled is carried along."""
    p = filtered_state_probs(left_right([5, 5, 5], [1, 1, 1]), np.empty((0, 3)), 30_000)
    np.testing.assert_allclose(p[100:], np.broadcast_to([0, 0, 1.0], (29_900, 3)), atol=1e-9)
