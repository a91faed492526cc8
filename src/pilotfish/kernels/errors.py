"""What the kernels refuse, in the same words whether compiled or not."""

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.types import Array, Float


def control_cost_error(t: int) -> NotPositiveDefinite:
    return NotPositiveDefinite(
        f"the control Hessian at step {t}, control_cost + B^T P B, has no Cholesky factor, expected it positive "
        "definite; make control_cost positive definite and every weight positive semidefinite"
    )


def transform_row_error(d: int) -> NotPositiveDefinite:
    return NotPositiveDefinite(
        f"row {d} of the semi-tied transform has no update: the covariances' weighted sum G_{d} has no "
        "Cholesky factor, expected it positive definite; add regularisation * I to every covariance, "
        "or give more data"
    )


def singular_transform_error() -> InvalidInput:
    return InvalidInput("the semi-tied transform has no inverse, expected one; start from the identity")


def covariance_error(k: int) -> NotPositiveDefinite:
    return NotPositiveDefinite(
        f"covariance {k} has no Cholesky factor, expected it positive definite; raise the regularisation"
    )


def datapoint_error(x: Float[Array, "N P D"], place: int) -> InvalidInput:
    n, p, d = (int(index) for index in np.unravel_index(place, x.shape))
    return InvalidInput(
        f"datapoint {n}, frame {p}, column {d} (first is 0) is {x[n, p, d]}, expected a number of at most "
        "1e100; leave the datapoint out"
    )
