"""Riccati recursion of finite-horizon linear-quadratic tracking (LQT)."""

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
    """Return the feedback that minimises sum_t |x_t - r_t|^2_W_t + |u_t|^2_R for x_t+1 = A_t x_t + B_t u_t.

    Args:
        A: System matrices: S = 1 for a time-invariant system, or S = T - 1.
        B: Input matrices, as A.
        weights: State costs W_t, symmetric positive semidefinite.
        targets: Targets r_t.
        control_cost: R, symmetric positive definite.

    Raises:
        NotPositiveDefinite: If control along some direction costs nothing.

    Source:
        Tanwani 2018, eqs. 3.50-3.53, with explicit indices; Anderson & Moore 1990.
    """
    T, n = targets.shape
    A, B = (np.broadcast_to(stack, (T - 1, *stack.shape[1:])) for stack in (A, B))
    gains, feedforwards = np.empty((T - 1, B.shape[2], n)), np.empty((T - 1, B.shape[2]))
    P, d = np.empty((T, n, n)), np.zeros((T, n))
    P[-1] = weights[-1]
    for t in range(T - 2, -1, -1):
        PB = P[t + 1] @ B[t]
        L = control_hessian_factor(control_cost + B[t].T @ PB, t)
        # gradient of the cost-to-go at the state that follows without control
        gradient = P[t + 1] @ (A[t] @ targets[t] - targets[t + 1]) + d[t + 1]
        gains[t] = solve(L, PB.T @ A[t])
        feedforwards[t] = -solve(L, B[t].T @ gradient)
        closed_loop = A[t] - B[t] @ gains[t]  # (n, n)
        value = weights[t] + A[t].T @ P[t + 1] @ closed_loop
        P[t], d[t] = 0.5 * (value + value.T), closed_loop.T @ gradient
    return gains, feedforwards, P, d


def control_hessian_factor(S: Float[Array, "m m"], t: int) -> Float[Array, "m m"]:
    """Return the Cholesky factor of the control Hessian at step t, R + B^T P B."""
    try:
        return np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        raise control_cost_error(t) from None


def solve(L: Float[Array, "m m"], right: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
    """Return (L L^T)^-1 right."""
    return np.linalg.solve(L.T, np.linalg.solve(L, right))
