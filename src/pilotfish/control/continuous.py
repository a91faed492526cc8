"""Linear quadratic tracking (LQT) and regulation (LQR) in continuous time, each target held for a period.

Homogeneous form. With the state (x, 1), the cost of a target r is a quadratic form without linear terms, and
the optimal cost-to-go is V = [P, -s; -s', c]. Here s = P r + d, where d is the costate offset of the thesis.
s is continuous where the target jumps, and its equation needs no derivative of the target.

Hamiltonian flow. State x and costate p, half the gradient of the cost-to-go, follow dx/dt = A x - G p and
-dp/dt = Q x + A' p with G = B R^-1 B'. Over a period this is an exact linear map with three matrices (A, G,
Q):

    x_after = A x_before - G p_after,    p_before = Q x_before + A' p_after.

The flow of two equal periods follows by elimination of the costate between them. A short flow, from a matrix
exponential, is doubled until it covers the period: the exponential of a long one would hold growing beside
decaying modes and lose the latter. The Riccati equation over a period is V_before = Q + A' V_after (I + G
V_after)^-1 A.

Invariants. G, Q and V stay symmetric positive semidefinite. A period cut into two halves gives the same
motion.
"""

import math

import numpy as np

from pilotfish.control.discrete import normalise_costs, stabilisability_error, symmetric_part
from pilotfish.control.feedback import Feedback
from pilotfish.control.reference import Reference, unique_weights
from pilotfish.control.systems import ContinuousSystem, discretise
from pilotfish.control.validation import (
    control_cost_matrix,
    require_reference,
    require_same_period,
    require_system,
    require_terminal,
)
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_period, require_type

Flow = tuple[Array, Array, Array]  # A, G, Q as at the head of this file, each (n, n)


def track_continuous(
    system: ContinuousSystem,
    reference: Reference,
    control_cost: float | Float[Array, "m m"],
    *,
    period: float,
    terminal: Float[Array, "n n"] | None = None,
) -> Feedback:
    """Compute the feedback that tracks a reference at minimum cost in continuous time (finite-horizon LQT).

    Minimises the integral of (x - r)' Q (x - r) + u' R u. targets[t] and weights[t] hold for period t. The
    last target begins when the time is over, so that it counts only through the terminal weight; the last
    weight is not used. Every period is integrated exactly.

    Args:
        system: Continuous dynamics.
        reference: Targets and weights at T steps; weights are costs per second.
        control_cost: R, or the number that multiplies the identity; a cost per second.
        period: Time between two targets [s].
        terminal: Weight of the last state; None for zero.

    Returns:
        Gains and feedforwards of T - 1 periods.

    Raises:
        InvalidInput: As `track`.
        NotPositiveDefinite: As `track`.

    Source:
        Tanwani 2018, equations 3.45-3.46, where the first mean of the latter stands for its derivative.
    """
    R = _validate_problem(system, reference, control_cost, period)
    end = np.zeros_like(system.A) if terminal is None else terminal
    require_terminal(end, len(system.A))
    with np.errstate(all="ignore"):
        value_matrices, closed_loops = _integrate_backwards(
            _period_flows(system, reference, R, period), _homogeneous_cost(end, reference.targets[-1])
        )
        feedback = np.linalg.solve(R, system.B.T) @ value_matrices  # R^-1 B' [P, -s]
    if not (np.isfinite(feedback).all() and np.isfinite(closed_loops).all()):
        raise InvalidInput(
            "the gains are not finite: the state overflows float64 within a period; choose a shorter period, "
            "or weights and control_cost of more similar size"
        )
    gains, targets = feedback[:, :, :-1], reference.targets[:-1]
    feedforwards = -feedback[:, :, -1] - np.einsum("tmn,tn->tm", gains, targets)  # R^-1 B' (s - P r)
    return Feedback(system, reference, float(period), gains, feedforwards, closed_loops)


def lqr_continuous(
    system: ContinuousSystem,
    reference: Reference,
    control_cost: float | Float[Array, "m m"],
    *,
    period: float,
) -> Feedback:
    """Compute for each period the infinite-horizon LQR gain of its weight, without feedforward.

    A constant target r is reached only if it is an equilibrium, A r = 0; otherwise the error (B K - A)^-1 A r
    remains. Costs one algebraic Riccati equation per distinct weight.

    Args:
        system: Continuous dynamics.
        reference: Targets and weights at T steps; the last ones are not used.
        control_cost: R, or the number that multiplies the identity.
        period: Time between two targets [s].

    Returns:
        Gains of T - 1 periods, and feedforwards of zero.

    Raises:
        InvalidInput: As `lqr`.
        NotPositiveDefinite: As `lqr`.

    Source:
        Tanwani 2018, equations 3.47 and 3.50; the solver is scipy.linalg.solve_continuous_are.
    """
    R = _validate_problem(system, reference, control_cost, period)
    weights, targets = reference.weights[:-1], reference.targets[:-1]
    first_indices, inverse = unique_weights(weights)
    gains = np.stack([_stabilising_gain(system, weights[t], R, f"weights[{t}]") for t in first_indices])
    gains = gains[inverse]
    first_indices, inverse = unique_weights(_stack_weights_and_targets(weights, targets))
    closed_loops = np.stack(
        [_closed_loop_transition(system, gains[t], targets[t], period) for t in first_indices]
    )[inverse]
    feedforwards = np.zeros(gains.shape[:2])
    return Feedback(system, reference, float(period), gains, feedforwards, closed_loops)


def hamiltonian_flow(
    A: Float[Array, "n n"], G: Float[Array, "n n"], Q: Float[Array, "n n"], time: float
) -> Flow:
    """Integrate the Hamiltonian equations exactly over a time [s], as at the head of this file.

    Source:
        Anderson 1978, Second-order convergent algorithms for the steady-state Riccati equation.
    """
    from scipy.linalg import expm  # slow to import

    n = len(A)
    hamiltonian = np.block([[A, -G], [-Q, -A.T]])
    doublings = math.ceil(math.log2(max(1.0, time * float(np.linalg.norm(hamiltonian, 1)))))
    short = expm(time / 2**doublings * hamiltonian)
    xp, px, pp = short[:n, n:], short[n:, :n], short[n:, n:]
    # p_after = px x + pp p is solved for p, and the flow is symplectic: x_after = pp^-T x + xp pp^-1 p_after
    flow = (
        np.linalg.solve(pp.T, np.eye(n)),
        -np.linalg.solve(pp.T, xp.T).T,
        -np.linalg.solve(pp, px),
    )
    for _ in range(doublings):
        flow = _double_flow(*flow)
    return flow


def _double_flow(A: Float[Array, "n n"], G: Float[Array, "n n"], Q: Float[Array, "n n"]) -> Flow:
    """Return the flow of two equal periods; the costate between them is eliminated."""
    between = np.eye(len(A)) + G @ Q
    half_A, half_G = np.linalg.solve(between, A), np.linalg.solve(between, G)
    return A @ half_A, G + A @ half_G @ A.T, Q + A.T @ Q @ half_A


def _validate_problem(
    system: ContinuousSystem, reference: Reference, control_cost: float | Float[Array, "m m"], period: float
) -> Float[Array, "m m"]:
    require_type(system, "system", ContinuousSystem, "see control.continuous_double_integrator")
    require_type(reference, "reference", Reference, "pf.plan makes one from an adapted skill")
    require_system(system.A, system.B, rank=2)
    require_period(period)
    require_same_period(reference.period, period)
    require_reference(reference.targets, reference.weights, len(system.A))
    return control_cost_matrix(control_cost, system.B.shape[1])


def _integrate_backwards(
    flows: list[Flow], end: Float[Array, "w w"]
) -> tuple[Float[Array, "S w-1 w"], Float[Array, "S w-1 w"]]:
    """Return for each period [P, -s] at its beginning and [transition, offset] of the closed loop over it."""
    value_matrices, closed_loops = [], []
    value = end
    for A, G, Q in reversed(flows):
        closed_loop = np.linalg.solve(np.eye(len(end)) + G @ value, A)
        value = symmetric_part(Q + A.T @ value @ closed_loop)
        value_matrices.append(value[:-1])
        closed_loops.append(closed_loop[:-1])
    return np.stack(value_matrices[::-1]), np.stack(closed_loops[::-1])


def _period_flows(
    system: ContinuousSystem, reference: Reference, R: Float[Array, "m m"], period: float
) -> list[Flow]:
    """Return the flow of (x, 1) over each period, computed once per distinct target and weight."""
    G = system.B @ np.linalg.solve(R, system.B.T)
    weights, targets = reference.weights[:-1], reference.targets[:-1]
    first_indices, inverse = unique_weights(_stack_weights_and_targets(weights, targets))
    flows = [_affine_flow(system.A, G, weights[t], targets[t], period) for t in first_indices]
    return [flows[i] for i in inverse]


def _affine_flow(
    A: Float[Array, "n n"],
    G: Float[Array, "n n"],
    weight: Float[Array, "n n"],
    target: Float[Array, " n"],
    period: float,
) -> Flow:
    """Return the flow of (x, 1), computed for (x - target, 1): a far target then costs no digits."""
    zero = np.zeros_like(target)
    drift = np.vstack([np.hstack([A, (A @ target)[:, None]]), np.zeros(len(A) + 1)])
    flow_A, flow_G, flow_Q = hamiltonian_flow(
        drift, _border_matrix(G, zero, 0.0), _border_matrix(weight, zero, 0.0), period
    )
    uncentre, centre = np.eye(len(drift)), np.eye(len(drift))
    uncentre[:-1, -1], centre[:-1, -1] = target, -target
    return uncentre @ flow_A @ centre, flow_G, centre.T @ flow_Q @ centre


def _stack_weights_and_targets(
    weights: Float[Array, "S n n"], targets: Float[Array, "S n"]
) -> Float[Array, "S n n+1"]:
    return np.concatenate([weights, targets[:, :, None]], axis=2)


def _homogeneous_cost(weight: Float[Array, "n n"], target: Float[Array, " n"]) -> Float[Array, "n+1 n+1"]:
    """Return (x - target)' weight (x - target) as a quadratic form of (x, 1)."""
    linear = -weight @ target
    return _border_matrix(weight, linear, -linear @ target)


def _border_matrix(
    block: Float[Array, "n n"], edge: Float[Array, " n"], corner: float
) -> Float[Array, "n+1 n+1"]:
    return np.block([[block, edge[:, None]], [edge[None, :], np.array([[corner]])]])


def _stabilising_gain(
    system: ContinuousSystem, weight: Float[Array, "n n"], R: Float[Array, "m m"], name: str
) -> Float[Array, "m n"]:
    from scipy.linalg import solve_continuous_are  # slow to import

    weight, R = normalise_costs(weight, R, name)
    A, B = system.A, system.B
    try:
        with np.errstate(all="ignore"):  # a bad solution is recognised by its gain
            P = solve_continuous_are(A, B, symmetric_part(weight), symmetric_part(R))
            K: Float[Array, "m n"] = np.linalg.solve(R, B.T @ P)
            stable = np.linalg.eigvals(A - B @ K).real.max() < 0
    except (np.linalg.LinAlgError, ValueError) as error:
        raise stabilisability_error(name) from error
    if not stable:
        raise stabilisability_error(name)
    return K


def _closed_loop_transition(
    system: ContinuousSystem, K: Float[Array, "m n"], target: Float[Array, " n"], period: float
) -> Float[Array, "n n+1"]:
    """Return [transition, offset] over a period under u = -K (x - target)."""
    feedback = system.B @ K
    loop = discretise(ContinuousSystem(system.A - feedback, (feedback @ target)[:, None]), period)
    return np.hstack([loop.A, loop.B])
