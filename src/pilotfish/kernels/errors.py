"""Errors of the kernels, which are the same for both implementations."""

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.types import Array, Float


def control_cost_error(t: int) -> NotPositiveDefinite:
    """Return the error for a control Hessian at step t that is not positive definite."""
    return NotPositiveDefinite(
        f"the control Hessian at step {t}, control_cost + B^T P B, has no Cholesky factor, expected it "
        "positive definite; make control_cost positive definite and every weight positive semidefinite"
    )


def transform_row_error(d: int) -> NotPositiveDefinite:
    """Return the error for row d of a semi-tied transform that has no update."""
    return NotPositiveDefinite(
        f"row {d} of the semi-tied transform has no update: the weighted sum G_{d} of the covariances has no "
        "Cholesky factor, expected it positive definite; add regularisation * I to every covariance, "
        "or give more data"
    )


def singular_transform_error() -> InvalidInput:
    """Return the error for a singular semi-tied transform."""
    return InvalidInput(
        "the semi-tied transform is singular, expected an invertible one; start from the identity"
    )


def covariance_error(k: int) -> NotPositiveDefinite:
    """Return the error for covariance k that is not positive definite."""
    return NotPositiveDefinite(
        f"covariance {k} has no Cholesky factor, expected it positive definite; raise the regularisation"
    )


def datapoint_error(x: Float[Array, "N P D"], index: int) -> InvalidInput:
    """Return the error for the value at a flat index of x that is not finite or too large."""
    n, p, d = (int(axis_index) for axis_index in np.unravel_index(index, x.shape))
    return InvalidInput(
        f"datapoint {n}, frame {p}, column {d} (first is 0) is {x[n, p, d]}, expected a number of at most "
        "1e100; leave the datapoint out"
    )
