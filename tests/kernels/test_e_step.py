"""E-step of a hidden Markov model against its definition, and the compiled kernel against the reference."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.kernels import Emissions, reference

SUMS = (
    "log_likelihoods",
    "counts",
    "initial_counts",
    "transition_counts",
    "deviation_sums",
    "scatter_matrices",
)


@pytest.mark.parametrize(("P", "N", "D", "K"), [(1, 1, 1, 1), (2, 5, 3, 2), (3, 33, 6, 3)])
def test_log_emissions_equal_sum_of_log_densities(kernels, case, P, N, D, K):
    """The value log b_k(x_n) is a sum over frames of the log-density of N(mean, (W^T W)^-1)."""
    given = case(P, [N], D, K)
    expected = np.zeros((N, K))
    for p in range(P):
        for k in range(K):
            W = given.precision_cholesky[p, k]
            density = multivariate_normal(given.means[p, k], np.linalg.inv(W.T @ W))
            expected[:, k] += density.logpdf(given.x[p])
    result = kernels.log_emissions(given.x, given.emissions)
    np.testing.assert_allclose(result, expected, rtol=1e-10)


def test_log_emissions_entries_above_diagonal_are_ignored(kernels, case):
    given = case(2, [40], 5, 3)
    stained = given.precision_cholesky + np.triu(np.full((5, 5), 1e9), 1)
    np.testing.assert_array_equal(
        kernels.log_emissions(given.x, Emissions(given.means, stained)),
        kernels.log_emissions(given.x, given.emissions),
    )


def test_e_step_end_probabilities_equal_enumeration_of_paths(kernels, case):
    """The weight of every path of states is multiplied by the end probability of its last state."""
    given, final = case(2, [5, 3], 3, 3), np.array([0.3, 0.0, 0.9])
    result = kernels.e_step(*given.arguments, final=final)
    parts = np.split(reference.log_emissions(given.x, given.emissions), [5])
    log_likelihoods, counts = [], np.zeros(3)
    for log_b in parts:
        total, visits = 0.0, np.zeros(3)
        for path in product(range(3), repeat=len(log_b)):
            steps = np.prod(given.transitions[path[:-1], path[1:]])
            weight = given.initial[path[0]] * steps * final[path[-1]]
            weight *= np.exp(log_b[range(len(path)), path].sum())
            total, visits = total + weight, visits + weight * np.bincount(path, minlength=3)
        log_likelihoods.append(np.log(total))
        counts += visits / total
    np.testing.assert_allclose(result.log_likelihoods, log_likelihoods, rtol=1e-10)
    np.testing.assert_allclose(result.counts, counts, rtol=1e-9)


def test_e_step_equals_sums_of_forward_backward(kernels, case):
    """Every sum is its definition, from state probabilities of single demonstrations."""
    given = case(2, [7, 1, 20], 4, 3)
    result = kernels.e_step(*given.arguments)
    log_emissions = reference.log_emissions(given.x, given.emissions)
    chains = [
        reference.forward_backward(part, given.initial, given.transitions)
        for part in np.split(log_emissions, np.cumsum(given.lengths)[:-1])
    ]
    gamma = np.concatenate([chain.smoothed_state_probs for chain in chains])
    error = given.x[:, :, None] - given.means[:, None]  # (P, N, K, D)
    expected = {
        "log_likelihoods": [chain.log_likelihood for chain in chains],
        "counts": gamma.sum(axis=0),
        "initial_counts": sum(chain.smoothed_state_probs[0] for chain in chains),
        "transition_counts": sum(chain.transition_counts for chain in chains),
        "deviation_sums": np.einsum("nk,pnki->pki", gamma, error),
        "scatter_matrices": np.einsum("nk,pnki,pnkj->pkij", gamma, error, error),
    }
    for name in SUMS:
        np.testing.assert_allclose(getattr(result, name), expected[name], rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("P", "lengths", "D", "K"),
    [
        (1, [1], 1, 1),
        (1, [1, 1, 1], 2, 3),
        (2, [31], 3, 2),
        (1, [32], 4, 8),
        (3, [33], 5, 9),
        (2, [64, 31, 1], 6, 4),
        (1, [255, 256, 257], 7, 3),
        (1, [513], 8, 2),
        (2, [200, 200, 200, 200], 14, 7),
        (1, [60], 20, 17),
        (1, [300], 94, 5),
    ],
)
def test_e_step_compiled_equals_reference(compiled, case, P, lengths, D, K):
    """Any shape: ones, odd dimensions, lengths at and near the edges of blocks and pages."""
    given = case(P, lengths, D, K)
    result, reference_result = compiled.e_step(*given.arguments), reference.e_step(*given.arguments)
    for name in SUMS:
        scale = np.abs(getattr(reference_result, name)).max()
        np.testing.assert_allclose(
            getattr(result, name),
            getattr(reference_result, name),
            rtol=1e-9,
            atol=1e-12 * scale,
            err_msg=name,
        )
    np.testing.assert_array_equal(result.scatter_matrices, result.scatter_matrices.swapaxes(-1, -2))
    np.testing.assert_allclose(
        compiled.log_emissions(given.x, given.emissions),
        reference.log_emissions(given.x, given.emissions),
        rtol=1e-11,
    )


def test_e_step_94_dimensions_and_certain_states_is_finite(compiled, case):
    """Emissions differ by thousands of nats, as in motion capture: nothing overflows."""
    given = case(1, [500], 94, 6)
    sharp = 30.0 * given.precision_cholesky
    arguments = (*given.arguments[:-1], Emissions(given.means, sharp))
    result, reference_result = compiled.e_step(*arguments), reference.e_step(*arguments)
    log_emissions = reference.log_emissions(given.x, Emissions(given.means, sharp))
    assert np.ptp(log_emissions, axis=1).min() > 1000.0
    for name in SUMS:
        assert np.isfinite(getattr(result, name)).all()
        scale = np.abs(getattr(reference_result, name)).max()
        np.testing.assert_allclose(
            getattr(result, name), getattr(reference_result, name), rtol=1e-6, atol=1e-9 * scale
        )


@pytest.mark.parametrize("rng", [0], indirect=True)
def test_e_step_hundred_thousand_steps_sum_to_length(compiled, case):
    """Counts and transitions sum to the length of one long demonstration."""
    given = case(1, [100_000], 2, 3)
    result, reference_result = compiled.e_step(*given.arguments), reference.e_step(*given.arguments)
    np.testing.assert_allclose(result.counts.sum(), 100_000, rtol=1e-12)
    np.testing.assert_allclose(result.transition_counts.sum(), 99_999, rtol=1e-12)
    for name in SUMS:
        np.testing.assert_allclose(
            getattr(result, name), getattr(reference_result, name), rtol=1e-7, err_msg=name
        )


def test_e_step_impossible_demonstration_adds_nothing(kernels, case):
    """Its log-likelihood is -inf; the sums are those of the others."""
    given = case(1, [4, 5], 2, 2)
    no_way_on = np.zeros((2, 2))
    result = kernels.e_step(given.x, np.array([8, 1]), given.initial, no_way_on, given.emissions)
    alone = kernels.e_step(given.x[:, 8:], np.array([1]), given.initial, no_way_on, given.emissions)
    assert result.log_likelihoods[0] == -np.inf
    for name in SUMS[1:]:
        np.testing.assert_allclose(getattr(result, name), getattr(alone, name), atol=1e-15, err_msg=name)


def test_e_step_any_order_of_demonstrations_is_equal(kernels, case):
    given = case(2, [9, 9], 3, 2)
    swapped = np.concatenate([given.x[:, 9:], given.x[:, :9]], axis=1)
    result = kernels.e_step(*given.arguments)
    reordered = kernels.e_step(swapped, *given.arguments[1:])
    np.testing.assert_allclose(reordered.log_likelihoods, result.log_likelihoods[::-1])
    for name in SUMS[1:]:
        np.testing.assert_allclose(getattr(reordered, name), getattr(result, name), rtol=1e-10, atol=1e-12)


def test_e_step_any_memory_layout_is_equal(kernels, case):
    """Transposed, strided or Fortran-ordered arguments."""
    given = case(2, [12], 4, 3)
    x = np.repeat(given.x, 2, axis=1)[:, ::2]
    odd = kernels.e_step(
        np.asfortranarray(x),
        given.lengths,
        *(np.asfortranarray(a) for a in given.arguments[2:4]),
        Emissions(np.asfortranarray(given.means), np.asfortranarray(given.precision_cholesky)),
    )
    plain = kernels.e_step(*given.arguments)
    for name in SUMS:
        np.testing.assert_allclose(getattr(odd, name), getattr(plain, name), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("M", [1, 2, 5, 37])
def test_e_step_any_number_of_threads_gives_same_bits(compiled, case, rng, M):
    """Groups of demonstrations are added in order."""
    given = case(2, rng.integers(300, 900, size=M).tolist(), 20, 8)
    alone = compiled.e_step(*given.arguments)
    for threads in (0, 2, 7):
        together = compiled.e_step(*given.arguments, threads=threads)
        for name in SUMS:
            np.testing.assert_array_equal(getattr(together, name), getattr(alone, name), err_msg=name)


@pytest.mark.parametrize("rng", [0], indirect=True)
def test_e_step_several_groups_equals_reference(compiled, case, rng):
    """Some of the demonstrations have one step."""
    lengths = [1, 2, *rng.integers(1, 400, size=60).tolist(), 3000, 1]
    given = case(2, lengths, 14, 6)
    result, reference_result = (
        compiled.e_step(*given.arguments, threads=2),
        reference.e_step(*given.arguments),
    )
    for name in SUMS:
        scale = np.abs(getattr(reference_result, name)).max()
        np.testing.assert_allclose(
            getattr(result, name),
            getattr(reference_result, name),
            rtol=1e-9,
            atol=1e-12 * scale,
            err_msg=name,
        )
