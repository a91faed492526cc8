"""Shared directions beyond one basis: more directions (EMLLT) and several bases (MLT)."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import (
    EMLLT,
    MLT,
    ExpandedPrecisions,
    Full,
    MultipleTransformCovariances,
    SemiTied,
)
from pilotfish.gaussians.structures.emllt import (
    add_directions,
    backtracking_step,
    update_directions,
    update_weights,
)


def samples(rng, K, D):
    A = rng.normal(size=(K, D, D))
    return A @ A.transpose(0, 2, 1) / D + 0.05 * np.eye(D), rng.uniform(1.0, 50.0, size=K)


def expansion(rng, K, R, D):
    """Return random precisions whose last R - D weights are negative."""
    A, weights = rng.normal(size=(R, D)), rng.uniform(0.5, 2.0, size=(K, R))
    positive = ExpandedPrecisions(A[:D], weights[:, :D]).dense
    weights[:, D:] = -0.5 / (R - D) / np.einsum("ri,kij,rj->kr", A[D:], positive, A[D:])
    return ExpandedPrecisions(A, weights)


def auxiliary(counts, S, covariances):
    """Return twice the expected log-likelihood that an M-step maximises (4.18), up to a constant."""
    fit = np.trace(np.linalg.solve(covariances, S), axis1=1, axis2=2)
    return -float(counts @ (np.linalg.slogdet(covariances)[1] + fit))


def run_estimates(structure, counts, S, steps):
    values, before = [], None
    for _ in range(steps):
        before = structure.estimate(counts, S, before)
        values.append(auxiliary(counts, S, before.dense))
    return values, before


def test_precisions_equal_weighted_sum_over_directions(rng):
    expanded = expansion(rng, 3, 6, 4)
    for k, dense in enumerate(expanded.dense):
        precision = sum(
            w * np.outer(a, a) for w, a in zip(expanded.weights[k], expanded.directions, strict=True)
        )
        np.testing.assert_allclose(np.linalg.inv(dense), precision, rtol=1e-8, atol=1e-10)


def test_precision_cholesky_is_lower_triangular_root_of_precision(rng):
    expanded = expansion(rng, 3, 6, 4)
    W = expanded.precision_cholesky("the covariance of state")
    np.testing.assert_array_equal(W, np.tril(W))
    np.testing.assert_allclose(
        W.transpose(0, 2, 1) @ W @ expanded.dense, np.tile(np.eye(4), (3, 1, 1)), atol=1e-9
    )


def test_precision_cholesky_indefinite_precision_raises_with_name(rng):
    expanded = expansion(rng, 3, 6, 4)
    expanded.weights[1, 0] = -50.0
    with pytest.raises(NotPositiveDefinite, match="the covariance of state 1"):
        expanded.precision_cholesky("the covariance of state")


def test_update_weights_last_weight_has_zero_derivative(rng):
    """It satisfies a^T Sigma a = a^T S a for the last direction."""
    S, _ = samples(rng, 3, 4)
    after = update_weights(expansion(rng, 3, 7, 4), S)
    a = after.directions[-1]
    np.testing.assert_allclose(after.dense @ a @ a, S @ a @ a, rtol=1e-8)


def test_update_weights_and_directions_raise_likelihood(rng):
    """Each alone, from a random expansion with negative weights."""
    S, counts = samples(rng, 4, 5)
    expanded = expansion(rng, 4, 9, 5)
    values = [auxiliary(counts, S, expanded.dense)]
    for _ in range(6):
        expanded = update_weights(expanded, S)
        values.append(auxiliary(counts, S, expanded.dense))
        expanded = update_directions(expanded, counts, S)
        values.append(auxiliary(counts, S, expanded.dense))
    assert np.diff(values).min() > 0.0


def test_update_directions_follows_gradient_of_likelihood(rng):
    """Against finite differences: a tiny step gains what the gradient predicts."""
    S, counts = samples(rng, 3, 4)
    expanded = update_weights(expansion(rng, 3, 6, 4), S)
    moved = update_directions(expanded, counts, S).directions[0] - expanded.directions[0]
    assert np.abs(moved).max() > 0.0

    def value(t):
        A = expanded.directions.copy()
        A[0] += t * moved
        return auxiliary(counts, S, ExpandedPrecisions(A, expanded.weights).dense)

    gradient = 2.0 * np.einsum(
        "k,kij,j->i", counts * expanded.weights[:, 0], expanded.dense - S, expanded.directions[0]
    )
    np.testing.assert_allclose((value(1e-5) - value(-1e-5)) / 2e-5, gradient @ moved, rtol=1e-5)
    assert gradient @ moved > 0.0


@pytest.mark.parametrize("length", [1.0, 30.0, 1e4])
def test_backtracking_step_returns_first_halved_step_that_gains(rng, length):
    """Against likelihoods of whole models."""
    S, counts = samples(rng, 3, 4)
    expanded = expansion(rng, 3, 6, 4)

    def value(step):
        A = expanded.directions.copy()
        A[5] += step
        moved = ExpandedPrecisions(A, expanded.weights)
        possible = np.linalg.eigvalsh(moved.precisions).min() > 0.0
        return auxiliary(counts, S, moved.dense) if possible else -np.inf

    uphill = np.einsum(
        "k,kij,j->i", counts * expanded.weights[:, 5], expanded.dense - S, expanded.directions[5]
    )
    for step in length * rng.normal(size=(15, 4)):  # most of them far from the steepest way
        step *= np.sign(uphill @ step)
        halved = (0.5**n * step for n in range(20))
        expected = next((h for h in halved if value(h) > value(0.0 * h)), 0.0 * step)
        found = backtracking_step(
            step, expanded.directions[5], expanded.weights[:, 5], counts, expanded.dense, S
        )
        np.testing.assert_allclose(found, expected)


def test_add_directions_no_random_direction_gains_more(rng):
    """For the likelihood of a single state."""
    S, counts = samples(rng, 4, 5)
    tied = EMLLT(5).estimate(counts, S, None)
    new = add_directions(tied, counts, S, 6).directions[-1:]
    directions = np.concatenate([new, rng.normal(size=(3000, 5))])
    model_variances, true = (np.einsum("ni,kij,nj->nk", directions, M, directions) for M in (tied.dense, S))
    gains = counts * (true / model_variances - 1.0 - np.log(true / model_variances))
    assert gains.max(axis=1).argmax() == 0


def test_emllt_directions_equal_to_columns_reach_semi_tied(rng):
    S, counts = samples(rng, 5, 6)
    tied, _ = run_estimates(SemiTied(1.0, sweeps=100), counts, S, 4)
    values, found = run_estimates(EMLLT(6), counts, S, 100)
    np.testing.assert_allclose(values[-1], tied[-1], rtol=1e-6)
    assert found.weights.min() > 0.0


def test_emllt_maximum_directions_reach_full(rng):
    """D (D + 1) / 2 directions span all symmetric matrices."""
    S, counts = samples(rng, 4, 3)
    values, found = run_estimates(EMLLT(6, sweeps=10), counts, S, 20)
    np.testing.assert_allclose(values[-1], auxiliary(counts, S, S), rtol=1e-6)
    np.testing.assert_allclose(found.dense, S, atol=1e-3)


@pytest.mark.parametrize("structure", [EMLLT(5), EMLLT(8), EMLLT(15), MLT(1), MLT(2), MLT(4)])
def test_estimate_likelihood_is_monotone_between_semi_tied_and_full(rng, structure):
    S, counts = samples(rng, 4, 5)
    values, _ = run_estimates(structure, counts, S, 30)
    assert np.diff(values).min() >= -1e-11 * abs(values[-1])
    assert values[-1] <= auxiliary(counts, S, Full().estimate(counts, S, None).dense) + 1e-8
    assert values[-1] >= run_estimates(SemiTied(), counts, S, 6)[0][-1]


@pytest.mark.parametrize("structure", [EMLLT(7), MLT(2)])
def test_estimate_changing_samples_never_lowers_likelihood(rng, structure):
    counts, before = rng.uniform(1.0, 50.0, size=5), None
    for S in (samples(rng, 5, 5)[0] for _ in range(6)):
        after = structure.estimate(counts, S, before)
        if before is not None:
            worse = auxiliary(counts, S, before.dense)
            assert auxiliary(counts, S, after.dense) >= worse - 1e-11 * abs(worse)
        before = after


def test_emllt_more_directions_are_more_likely(rng):
    S, counts = samples(rng, 5, 4)
    values = [run_estimates(EMLLT(count), counts, S, 20)[0][-1] for count in (4, 6, 8, 10)]
    assert np.diff(values).min() > 0.0


def test_mlt_one_transform_equals_semi_tied(rng):
    S, counts = samples(rng, 5, 5)
    np.testing.assert_allclose(
        run_estimates(MLT(1), counts, S, 60)[0][-1],
        run_estimates(SemiTied(1.0, sweeps=100), counts, S, 4)[0][-1],
        rtol=1e-7,
    )


def test_mlt_one_transform_per_state_equals_full(rng):
    S, counts = samples(rng, 3, 4)
    found = MLT(3).estimate(counts, S, None)
    np.testing.assert_allclose(found.dense, S, atol=1e-9)
    np.testing.assert_array_equal(found.membership.sum(axis=0), np.ones(3))


def test_mlt_two_generating_bases_are_recovered(rng):
    """Two bases of five states each: the assignment and the samples are recovered."""
    H, variances = rng.normal(size=(2, 4, 4)), rng.uniform(0.05, 5.0, size=(10, 4))
    origin = rng.permutation(np.repeat([0, 1], 5))
    roots = H[origin] * np.sqrt(variances)[:, None, :]
    S = roots @ roots.transpose(0, 2, 1)
    _, found = run_estimates(MLT(2, sweeps=50), np.ones(10), S, 30)
    choice = found.membership.argmax(axis=1)
    assert len(set(zip(choice, origin, strict=True))) == 2
    np.testing.assert_allclose(found.dense, S, rtol=1e-3, atol=1e-3 * np.abs(S).max())


def test_mlt_unused_transform_is_reinitialised(rng):
    """Of two equal transforms, all states take the first; the second is given to the state with most loss."""
    S, counts = samples(rng, 4, 3)
    tied = MLT(1).estimate(counts, S, None)
    twice = MultipleTransformCovariances(
        np.repeat(tied.bases, 2, axis=0), tied.variances, np.eye(2)[[0, 0, 1, 1]]
    )
    found = MLT(2).estimate(counts, S, twice)
    assert found.membership.sum(axis=0).min() >= 1.0
    assert auxiliary(counts, S, found.dense) > auxiliary(counts, S, tied.dense)


@pytest.mark.parametrize(
    ("structure", "match"), [(EMLLT(3), "from 4"), (EMLLT(11), "to 10"), (MLT(4), "states")]
)
def test_estimate_sizes_outside_range_raise(rng, structure, match):
    S, counts = samples(rng, 3, 4)
    with pytest.raises(InvalidInput, match=match):
        structure.estimate(counts, S, None)


@pytest.mark.parametrize("make", [EMLLT, MLT])
@pytest.mark.parametrize("arguments", [(0,), (-1,), (4, 0)])
def test_structure_invalid_counts_raise(make, arguments):
    with pytest.raises(InvalidInput, match=r"directions|transforms|sweeps"):
        make(*arguments)


@pytest.mark.parametrize("structure", [EMLLT(6), MLT(2)])
def test_estimate_sample_without_variance_raises(rng, structure):
    S, counts = samples(rng, 3, 4)
    S[1] = np.diag([1.0, 1.0, 1.0, 0.0])
    with pytest.raises(NotPositiveDefinite, match="regularisation"):
        structure.estimate(counts, S, None)
