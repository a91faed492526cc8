"""Linear quadratic tracking as one least-squares problem: reference solution of `track`, and covariances."""

import numpy as np

from pilotfish.control.discrete import validate_problem
from pilotfish.control.feedback import Motion
from pilotfish.control.reference import Reference
from pilotfish.control.systems import DiscreteSystem, TimeVaryingSystem
from pilotfish.control.validation import require_start
from pilotfish.types import Array, Float


def solve_batch(
    system: DiscreteSystem,
    reference: Reference,
    control_cost: float | Float[Array, "m m"],
    start: Float[Array, " n"],
) -> tuple[Motion, Float[Array, "T n n"]]:
    """Compute the motion of least cost and the covariance of its states.

    The motion is that of `track(system, reference, control_cost).rollout(start)`. If motions have the density
    exp(-cost / 2), each state is Gaussian about it. This is the posterior of a trajectory whose targets were
    observed with precision weights[t] and whose inputs are a priori N(0, R^-1).

    Costs O((T m)^3) time and O(T^2 n m) memory: 200 steps of a 14-dimensional state take about a second.

    Args:
        system: Dynamics over each period.
        reference: Targets and weights.
        control_cost: R, or the number that multiplies the identity.
        start: First state.

    Returns:
        The motion, and the covariance of the state at each step; that of the first is zero.

    Raises:
        InvalidInput: As `track`, and if start is not a finite state.
        NotPositiveDefinite: As `track`.

    Source:
        Calinon 2016, A tutorial on task-parameterized movement learning and retrieval, on batch LQT.
    """
    R = validate_problem(system, reference, control_cost)
    require_start(start, system.B.shape[-2])
    from scipy.linalg import cho_solve, solve_triangular  # slow to import

    T, n = reference.targets.shape
    free, forced = _free_and_forced_responses(system.over(T - 1))
    weighted = np.einsum("tij,tjc->tic", reference.weights, forced)
    hessian = np.tensordot(forced, weighted, ((0, 1), (0, 1))) + np.kron(np.eye(T - 1), R)
    L = np.linalg.cholesky(hessian)
    error = reference.targets - free @ start
    u = cho_solve((L, True), np.einsum("tic,ti->c", weighted, error))
    scaled_responses = solve_triangular(L, forced.reshape(T * n, -1).T, lower=True).reshape(-1, T, n)
    motion = Motion(free @ start + forced @ u, u.reshape(T - 1, -1), system.period)
    return motion, np.einsum("cti,ctj->tij", scaled_responses, scaled_responses)


def _free_and_forced_responses(
    system: TimeVaryingSystem,
) -> tuple[Float[Array, "T n n"], Float[Array, "T n U"]]:
    """Return the matrices of x[t] = free[t] start + forced[t] u, where u is the vector of all inputs."""
    S, n, m = system.B.shape
    free, forced = np.zeros((S + 1, n, n)), np.zeros((S + 1, n, S * m))
    free[0] = np.eye(n)
    for t in range(S):
        free[t + 1] = system.A[t] @ free[t]
        forced[t + 1] = system.A[t] @ forced[t]
        forced[t + 1, :, t * m : (t + 1) * m] = system.B[t]
    return free, forced
