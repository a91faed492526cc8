"""Tracking as one big least-squares problem: the recursion's oracle, and the spread of its motion."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control.discrete import validate_problem
from pilotfish.control.feedback import Motion
from pilotfish.control.reference import Reference
from pilotfish.control.systems import DiscreteSystem, broadcast_system
from pilotfish.control.validation import require_start
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class BatchSolution:
    """The motion of least cost c, and the covariance of each x_t if motions have density exp(-c / 2).

    That is the posterior of a trajectory whose targets were seen with precision weights[t], and whose inputs
    are a priori N(0, R^-1). The first state is given, so its covariance is zero.
    """

    motion: Motion
    covariances: Float[Array, "T n n"]


def solve_batch(
    system: DiscreteSystem,
    reference: Reference,
    control_cost: float | Float[Array, "m m"],
    start: Float[Array, " n"],
) -> BatchSolution:
    """The motion of `track(system, reference, control_cost).rollout(start)`, found at once, and its covariance.

    Costs O((T m)^3) time and O(T^2 n m) memory: 200 steps of a 14-dimensional state take about a second.
    Raises: InvalidInput and NotPositiveDefinite, as `track` does, also when start is not a finite state.
    Source: Calinon 2016, A tutorial on task-parameterized movement learning and retrieval, on batch LQT.
    """
    R = validate_problem(system, reference, control_cost)
    require_start(start, system.B.shape[-2])
    from scipy.linalg import cho_solve, solve_triangular  # slow to import

    T, n = reference.targets.shape
    free, forced = _free_and_forced_responses(broadcast_system(system, T - 1))
    weighted = np.einsum("tij,tjc->tic", reference.weights, forced)
    hessian = np.tensordot(forced, weighted, ((0, 1), (0, 1))) + np.kron(np.eye(T - 1), R)
    L = np.linalg.cholesky(hessian)
    error = reference.targets - free @ start
    u = cho_solve((L, True), np.einsum("tic,ti->c", weighted, error))
    scaled_responses = solve_triangular(L, forced.reshape(T * n, -1).T, lower=True).reshape(-1, T, n)
    motion = Motion(free @ start + forced @ u, u.reshape(T - 1, -1), system.period)
    return BatchSolution(motion, np.einsum("cti,ctj->tij", scaled_responses, scaled_responses))


def _free_and_forced_responses(
    system: DiscreteSystem,
) -> tuple[Float[Array, "T n n"], Float[Array, "T n U"]]:
    """Every state as free[t] start + forced[t] (all inputs, one after the other)."""
    S, n, m = system.B.shape
    free, forced = np.zeros((S + 1, n, n)), np.zeros((S + 1, n, S * m))
    free[0] = np.eye(n)
    for t in range(S):
        free[t + 1] = system.A[t] @ free[t]
        forced[t + 1] = system.A[t] @ forced[t]
        forced[t + 1, :, t * m : (t + 1) * m] = system.B[t]
    return free, forced
