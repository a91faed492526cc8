"""Row updates of the semi-tied transform."""

import numpy as np

from pilotfish.kernels.errors import singular_transform_error, transform_row_error
from pilotfish.types import Array, Float


def semi_tied_sweeps(
    scatter_matrices: Float[Array, "K D D"],
    counts: Float[Array, " K"],
    transform: Float[Array, "D D"],
    sweeps: int,
) -> Float[Array, "D D"]:
    """A transform B under which the sample covariances S_k = scatters[k] are closer to diagonal together.

    No sweep lowers  sum_k mass_k (2 log |det B| - log |diag(B S_k B^T)|),  twice what the log-likelihood owes
    to B when Sigma_k = B^-1 diag(B S_k B^T) B^-T. States without mass are left out.
    Raises: NotPositiveDefinite, when a covariance leaves a direction without any variance; InvalidInput, when
    transform has no inverse.
    Source: Gales 1999; Tanwani 2018, eqs. 4.17-4.24. The cofactors' scale cancels, so rows of B^-T stand for
    them, kept up to date by a rank-one inverse update for each row.
    """
    S, N = scatter_matrices[counts > 0.0], counts[counts > 0.0]
    B = transform.copy()
    for _ in range(sweeps):
        inverse = invert(B)
        variances = np.einsum("di,kij,dj->kd", B, S, B)  # (K, D); row d of B alone decides column d
        for d in range(len(B)):
            cofactors = inverse[:, d].copy()  # row d of B^-T
            G = np.einsum("k,kij->ij", row_precisions(N, variances[:, d], d), S)
            direction = solve(G, cofactors, d)
            row = direction * np.sqrt(N.sum() / (cofactors @ direction))
            change = (row - B[d]) @ inverse
            inverse -= np.outer(cofactors, change) / (1.0 + change[d])  # Sherman & Morrison 1950
            B[d] = row
    return B


def invert(B: Float[Array, "D D"]) -> Float[Array, "D D"]:
    try:
        inverse: Float[Array, "D D"] = np.linalg.inv(B)
    except np.linalg.LinAlgError:
        raise singular_transform_error() from None
    return inverse


def row_precisions(N: Float[Array, " K"], variances: Float[Array, " K"], d: int) -> Float[Array, " K"]:
    """Precision that every state gives to row d."""
    if not (variances > 0.0).all():
        raise transform_row_error(d)
    precisions: Float[Array, " K"] = N / variances
    return precisions


def solve(G: Float[Array, "D D"], right: Float[Array, " D"], d: int) -> Float[Array, " D"]:
    """G^-1 right, for row d."""
    try:
        L = np.linalg.cholesky(G)
    except np.linalg.LinAlgError:
        raise transform_row_error(d) from None
    solution: Float[Array, " D"] = np.linalg.solve(L.T, np.linalg.solve(L, right))
    return solution
