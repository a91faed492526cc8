"""Scaled forward-backward gives the same sums as the recursion in logarithms."""

import numpy as np
import pytest

from pilotfish.kernels import Emissions, reference


def expected_sums(kernels, log_emissions, initial, transitions, lengths=None):
    """Return the e_step of Gaussians whose log-densities are log_emissions, up to a constant of each step.

    Means at R along each axis give state k at x the log-density R x_k, plus a term that is equal for all
    states.
    """
    T, K = log_emissions.shape
    R = max(1.0, np.sqrt(np.abs(log_emissions).max()))
    emissions = Emissions(R * np.eye(K)[None], np.tile(np.eye(K), (1, K, 1, 1)))
    lengths = np.array([T]) if lengths is None else lengths
    return kernels.e_step(log_emissions[None] / R, lengths, initial, transitions, emissions)


def assert_equal_sums(compiled, problem, atol=1e-12):
    found, reference_result = expected_sums(compiled, *problem), expected_sums(reference, *problem)
    np.testing.assert_allclose(found.log_likelihoods, reference_result.log_likelihoods, rtol=1e-12)
    for name in ("counts", "initial_counts", "transition_counts"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(reference_result, name), rtol=1e-7, atol=atol, err_msg=name
        )
    assert not found.initial_counts[np.asarray(problem[1]) == 0.0].any()
    assert not found.transition_counts[np.asarray(problem[2]) == 0.0].any()


@pytest.mark.parametrize("zeros", [0.0, 0.5])
@pytest.mark.parametrize("spread", [1.0, 30.0, 300.0, 5000.0])
@pytest.mark.parametrize(("T", "K"), [(1, 1), (1, 4), (2, 3), (40, 2), (60, 7), (33, 9), (25, 17)])
def test_e_step_scaled_equals_logarithms(compiled, chain, T, K, spread, zeros):
    """From indistinguishable to certain states; impossible states stay at zero."""
    assert_equal_sums(compiled, chain(T, K, spread, zeros))


@pytest.mark.parametrize("spread", [1.0, 30.0, 700.0])
def test_e_step_left_to_right_chain_equals_logarithms(compiled, rng, spread):
    """Zeros of the chain are not underflow: the path visits all states in order."""
    K, each = 8, 6
    labels = np.repeat(np.arange(K), each)
    log_emissions = -spread * (rng.random((K * each, K)) + (labels[:, None] != np.arange(K)))
    transitions = 0.8 * np.eye(K) + 0.2 * np.eye(K, k=1)
    assert_equal_sums(compiled, (log_emissions, np.eye(K)[0], transitions))


@pytest.mark.parametrize("early", [-9000.0, -800.0, -360.0, -120.0])
@pytest.mark.parametrize("rare", [1e-12, 1e-200, 1e-310])
def test_e_step_unlikely_late_transition_is_found(compiled, rare, early):
    """Before it state 1 is unlikely, after it the only one: probabilities fall to 1e-90000."""
    T, turn = 40, 25
    log_emissions = np.zeros((T, 2))
    log_emissions[:turn, 1], log_emissions[turn:, 0] = early, -1e4
    problem = log_emissions, np.array([1.0, 0.0]), np.array([[1.0, rare], [0.0, 1.0]])
    assert_equal_sums(compiled, problem, atol=1e-9)


@pytest.mark.parametrize("lost", [-710.0, -800.0, -5000.0])
@pytest.mark.parametrize("regained", [60.0, 200.0])
def test_e_step_state_lost_and_regained_equals_logarithms(compiled, lost, regained):
    """State 1 falls behind by more than a double can represent, leads for 20 steps, and falls behind again.

    In total state 1 leads by a thousand nats, which no single step shows.
    """
    gains = np.full(20, (1000.0 - 2.0 * lost) / 20) if regained == 200.0 else np.full(40, regained)
    ahead = np.concatenate([[0.0, lost], gains, [lost, 0.0]])
    ahead[-1] += 1000.0 - ahead.sum()
    log_emissions = np.stack([np.minimum(-ahead, 0.0), np.minimum(ahead, 0.0)], axis=1)
    assert_equal_sums(compiled, (log_emissions, np.full(2, 0.5), np.eye(2)), atol=1e-9)


def test_e_step_one_demonstration_beyond_scaling_leaves_others(compiled, chain):
    """A demonstration beyond scaling between two within it."""
    log_emissions, initial, transitions = chain(60, 3, 1.0)
    log_emissions[20:40] *= 4000.0
    lengths = np.array([20, 20, 20])
    found = expected_sums(compiled, log_emissions, initial, transitions, lengths)
    reference_result = expected_sums(reference, log_emissions, initial, transitions, lengths)
    for name in ("log_likelihoods", "counts", "initial_counts", "transition_counts"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(reference_result, name), rtol=1e-8, err_msg=name
        )


def test_e_step_impossible_demonstration_adds_nothing(compiled):
    """Its log-likelihood is -inf; the next one counts as if it were alone."""
    dead_end = np.array([[0.0, 1.0], [0.0, 0.0]])
    found = expected_sums(compiled, np.zeros((5, 2)), np.array([1.0, 0.0]), dead_end, np.array([3, 2]))
    assert found.log_likelihoods[0] == -np.inf
    np.testing.assert_allclose(found.counts, [1.0, 1.0])
    np.testing.assert_allclose(found.transition_counts, [[0.0, 1.0], [0.0, 0.0]])


def test_e_step_state_of_tiny_count_keeps_its_moments(compiled, rng):
    """Weights are negligible relative to the largest of their own state, here 1e-50."""
    x = rng.normal(size=(1, 300, 2))
    x[0, 150:, 0] += 40.0
    means = np.zeros((1, 3, 2))
    means[0, 1, 0], means[0, 2, 1] = 40.0, 19.0
    emissions = Emissions(means, np.tile(np.eye(2), (1, 3, 1, 1)))
    arguments = x, np.array([300]), np.full(3, 1.0 / 3.0), np.full((3, 3), 1.0 / 3.0), emissions
    found, reference_result = compiled.e_step(*arguments), reference.e_step(*arguments)
    assert reference_result.counts[2] < 1e-45
    for k in range(3):
        np.testing.assert_allclose(found.counts[k], reference_result.counts[k], rtol=1e-9)
        for result, expected in [
            (found.deviation_sums[0, k], reference_result.deviation_sums[0, k]),
            (found.scatter_matrices[0, k], reference_result.scatter_matrices[0, k]),
        ]:
            np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-13 * np.abs(expected).max())
