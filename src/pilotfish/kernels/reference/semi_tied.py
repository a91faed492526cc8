"""Row-wise ascent of the semi-tied transform."""

import numpy as np

from pilotfish.kernels.errors import singular_transform_error, transform_row_error
from pilotfish.types import Array, Float


def semi_tied_sweeps(
    scatter_matrices: Float[Array, "K D D"],
    counts: Float[Array, " K"],
    transform: Float[Array, "D D"],
    sweeps: int,
) -> Float[Array, "D D"]:
    """Return a transform B under which all sample covariances S_k are closer to diagonal.

    No sweep lowers sum_k N_k (2 log |det B| - log |diag(B S_k B^T)|), which is twice the part of the
    log-likelihood that depends on B if Sigma_k = B^-1 diag(B S_k B^T) B^-T. States with zero count are
    ignored.

    Args:
        scatter_matrices: Sample covariances S_k.
        counts: Weights N_k.
        transform: Initial B, invertible.
        sweeps: Passes over the rows.

    Raises:
        NotPositiveDefinite: If the covariances leave a direction without variance.
        InvalidInput: If transform is singular.

    Source:
        Gales 1999; Tanwani 2018, eqs. 4.17-4.24. The scale of the cofactors cancels, so rows of B^-T replace
        them; a rank-one update of the inverse keeps them current after each row.
    """
    S, N = scatter_matrices[counts > 0.0], counts[counts > 0.0]
    B = transform.copy()
    for _ in range(sweeps):
        inverse = invert(B)
        variances = np.einsum("di,kij,dj->kd", B, S, B)  # (K, D); column d depends on row d of B only
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
    """Return B^-1, or raise InvalidInput."""
    try:
        inverse: Float[Array, "D D"] = np.linalg.inv(B)
    except np.linalg.LinAlgError:
        raise singular_transform_error() from None
    return inverse


def row_precisions(N: Float[Array, " K"], variances: Float[Array, " K"], d: int) -> Float[Array, " K"]:
    """Return N_k over the variance of row d in every state."""
    if not (variances > 0.0).all():
        raise transform_row_error(d)
    precisions: Float[Array, " K"] = N / variances
    return precisions


def solve(G: Float[Array, "D D"], right: Float[Array, " D"], d: int) -> Float[Array, " D"]:
    """Return G^-1 right, for row d."""
    try:
        L = np.linalg.cholesky(G)
    except np.linalg.LinAlgError:
        raise transform_row_error(d) from None
    solution: Float[Array, " D"] = np.linalg.solve(L.T, np.linalg.solve(L, right))
    return solution
