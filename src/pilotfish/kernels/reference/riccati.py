"""The Riccati recursion of the finite-horizon tracker."""

import numpy as np

from pilotfish.kernels.errors import control_cost_error
from pilotfish.kernels.results import RiccatiSolution
from pilotfish.types import Array, Float


def riccati(
    A: Float[Array, "S n n"],
    B: Float[Array, "S n m"],
    weights: Float[Array, "T n n"],
    targets: Float[Array, "T n"],
    control_cost: Float[Array, "m m"],
) -> RiccatiSolution:
    """Feedback at least cost sum_t |x_t - targets_t|^2_weights_t + |u_t|^2_effort, x_t+1 = A_t x_t + B_t u_t.

    S is 1 (time-invariant) or T - 1. Weights are symmetric.
    Raises: NotPositiveDefinite, when pushing costs nothing along some direction.
    Source: Tanwani 2018, eqs. 3.50-3.53, indices made explicit; Anderson & Moore 1990.
    """
    T, n = targets.shape
    A, B = (np.broadcast_to(stack, (T - 1, *stack.shape[1:])) for stack in (A, B))
    gains, feedforwards = np.empty((T - 1, B.shape[2], n)), np.empty((T - 1, B.shape[2]))
    P, d = np.empty((T, n, n)), np.zeros((T, n))
    P[-1] = weights[-1]
    for t in range(T - 2, -1, -1):
        PB = P[t + 1] @ B[t]
        L = control_hessian_factor(control_cost + B[t].T @ PB, t)
        gradient = (
            P[t + 1] @ (A[t] @ targets[t] - targets[t + 1]) + d[t + 1]
        )  # gradient where the drift alone leads
        gains[t] = solve(L, PB.T @ A[t])
        feedforwards[t] = -solve(L, B[t].T @ gradient)
        closed = A[t] - B[t] @ gains[t]  # (n, n), the system under feedback
        value = weights[t] + A[t].T @ P[t + 1] @ closed
        P[t], d[t] = 0.5 * (value + value.T), closed.T @ gradient
    return RiccatiSolution(gains, feedforwards, P, d)


def control_hessian_factor(S: Float[Array, "m m"], t: int) -> Float[Array, "m m"]:
    """Cholesky factor of the cost of pushing at step t, S = R + B^T P B."""
    try:
        return np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        raise control_cost_error(t) from None


def solve(L: Float[Array, "m m"], right: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
    """(L L^T)^-1 right."""
    return np.linalg.solve(L.T, np.linalg.solve(L, right))
