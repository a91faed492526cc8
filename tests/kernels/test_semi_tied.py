"""Semi-tied transform: ascent of the auxiliary function to a stationary point."""

import numpy as np
import pytest

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.kernels import reference


def covariances(rng, K, D):
    roots = rng.normal(size=(K, D, 2 * D))
    return roots @ roots.swapaxes(1, 2) / (2 * D), rng.uniform(10.0, 100.0, K)


def auxiliary(B, S, N):
    """Return sum_k N_k (2 log |det B| - log |diag(B S_k B^T)|)."""
    variances = np.einsum("di,kij,dj->kd", B, S, B)
    return N.sum() * 2.0 * np.linalg.slogdet(B)[1] - N @ np.log(variances).sum(axis=1)


def auxiliary_gradient(B, S, N):
    """Return the derivative by B: 2 (sum_k N_k) B^-T - 2 sum_k N_k diag(B S_k B^T)^-1 B S_k."""
    variances = np.einsum("di,kij,dj->kd", B, S, B)
    pull = np.einsum("k,kd,di,kij->dj", N, 1.0 / variances, B, S)
    return 2.0 * (N.sum() * np.linalg.inv(B).T - pull)


@pytest.mark.parametrize(("K", "D"), [(1, 1), (2, 3), (7, 14), (5, 9)])
def test_semi_tied_sweeps_never_lower_auxiliary_function(kernels, rng, K, D):
    """Each of thirty sweeps; the first one raises it."""
    S, N = covariances(rng, K, D)
    B, heights = np.eye(D), [auxiliary(np.eye(D), S, N)]
    for _ in range(30):
        B = kernels.semi_tied_sweeps(S, N, B, 1)
        heights.append(auxiliary(B, S, N))
    assert (np.diff(heights) >= -1e-9 * np.abs(heights[0])).all()
    assert D == 1 or heights[1] > heights[0]


def test_semi_tied_sweeps_converge_to_stationary_point(kernels, rng):
    """The derivative is checked by finite differences."""
    S, N = covariances(rng, 4, 3)
    step, some = 1e-6, np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    nudges = step * np.eye(9).reshape(9, 3, 3)
    slopes = [(auxiliary(some + n, S, N) - auxiliary(some - n, S, N)) / (2 * step) for n in nudges]
    np.testing.assert_allclose(
        np.reshape(slopes, (3, 3)), auxiliary_gradient(some, S, N), rtol=1e-5, atol=1e-4
    )
    B = kernels.semi_tied_sweeps(S, N, np.eye(3), 3000)
    np.testing.assert_allclose(auxiliary_gradient(B, S, N), 0.0, atol=1e-6 * N.sum())


def test_semi_tied_sweeps_shared_basis_is_diagonalised(kernels, rng):
    """For Sigma_k = H Lambda_k H^T."""
    H = rng.normal(size=(3, 3))
    S = np.stack([H @ np.diag(rng.uniform(0.1, 5.0, 3)) @ H.T for _ in range(4)])
    B = kernels.semi_tied_sweeps(S, np.ones(4), np.eye(3), 5000)
    turned = B @ S @ B.T
    scale = np.sqrt(np.einsum("kii,kjj->kij", turned, turned))
    np.testing.assert_allclose(turned / scale, np.broadcast_to(np.eye(3), (4, 3, 3)), atol=1e-6)


@pytest.mark.parametrize(("K", "D", "sweeps"), [(1, 1, 1), (3, 2, 4), (7, 14, 20), (4, 15, 3), (2, 94, 2)])
def test_semi_tied_sweeps_compiled_equals_reference(compiled, rng, K, D, sweeps):
    S, N = covariances(rng, K, D)
    start = np.eye(D) + 0.01 * rng.normal(size=(D, D))
    result, reference_result = (
        compiled.semi_tied_sweeps(S, N, start, sweeps),
        reference.semi_tied_sweeps(S, N, start, sweeps),
    )
    np.testing.assert_allclose(result, reference_result, rtol=1e-7, atol=1e-9)


def test_semi_tied_sweeps_zero_sweeps_return_a_copy(kernels, rng):
    S, N = covariances(rng, 2, 3)
    start = rng.normal(size=(3, 3))
    result = kernels.semi_tied_sweeps(S, N, start, 0)
    np.testing.assert_array_equal(result, start)
    assert not np.shares_memory(result, start)


def test_semi_tied_sweeps_zero_counts_are_ignored(kernels, rng):
    S, N = covariances(rng, 3, 4)
    S[1], N[1] = 0.0, 0.0
    with_it = kernels.semi_tied_sweeps(S, N, np.eye(4), 3)
    np.testing.assert_allclose(with_it, kernels.semi_tied_sweeps(S[::2], N[::2], np.eye(4), 3))


def test_semi_tied_sweeps_no_variance_raises_with_row(kernels, rng):
    S, N = covariances(rng, 2, 3)
    S[:, 1, :], S[:, :, 1] = 0.0, 0.0
    with pytest.raises(NotPositiveDefinite, match=r"row 0 .* add regularisation"):
        kernels.semi_tied_sweeps(S, N, np.eye(3), 1)


def test_semi_tied_sweeps_singular_transform_raises(kernels, rng):
    S, N = covariances(rng, 2, 3)
    with pytest.raises(InvalidInput, match="singular"):
        kernels.semi_tied_sweeps(S, N, np.zeros((3, 3)), 1)
