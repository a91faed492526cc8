"""Linear quadratic tracking and regulation in continuous time; a target is held for a period."""

import numpy as np

from pilotfish.control.discrete import normalise_costs, stabilisability_error, symmetric_part
from pilotfish.control.feedback import ContinuousFeedback
from pilotfish.control.flow import HamiltonianFlow, hamiltonian_flow
from pilotfish.control.reference import Reference, unique_weights
from pilotfish.control.systems import ContinuousSystem, discretise
from pilotfish.control.validation import (
    control_cost_matrix,
    require_period,
    require_reference,
    require_same_period,
    require_system,
    require_terminal,
)
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_type


def track_continuous(
    system: ContinuousSystem,
    reference: Reference,
    control_cost: float | Float[Array, "m m"],
    *,
    period: float,
    terminal: Float[Array, "n n"] | None = None,
) -> ContinuousFeedback:
    """The feedback that makes the integral of  |x - target|^2 in weight  +  |u|^2 in effort  least.

    targets[t] and weights[t] hold for the t-th period [s]. The last target begins when the time is over: it
    counts only by the terminal weight, the price of the last state (none if not given). The last weight never
    does.
    The Riccati equation is carried backwards with s = P mu + d in place of d: s does not jump where the
    target mu does, and its equation needs no derivative of mu. Every period is integrated exactly.
    control_cost is R, or the number that multiplies the identity; running prices are per second.
    Raises: InvalidInput and NotPositiveDefinite, as `track` does.
    Source: the thesis, equations 3.45-3.46, where the first mean of the latter stands for its derivative.
    """
    R = _validate_problem(system, reference, control_cost, period)
    end = np.zeros_like(system.A) if terminal is None else terminal
    require_terminal(end, len(system.A))
    with np.errstate(all="ignore"):
        value_matrices, closed_loops = _integrate_backwards(
            _period_flows(system, reference, R, period), _homogeneous_cost(end, reference.targets[-1])
        )
        pull = np.linalg.solve(R, system.B.T) @ value_matrices  # R^-1 B^T [P, -s]
    if not (np.isfinite(pull).all() and np.isfinite(closed_loops).all()):
        raise InvalidInput(
            "the gains are not finite: within a period the system outgrows what numbers can hold; choose a "
            "shorter period, or weights and effort of more similar size"
        )
    gains, targets = pull[:, :, :-1], reference.targets[:-1]
    feedforwards = -pull[:, :, -1] - np.einsum("tmn,tn->tm", gains, targets)  # R^-1 B^T (s - P mu)
    return ContinuousFeedback(
        system, reference, float(period), gains, feedforwards, closed_loops[:, :, :-1], closed_loops[:, :, -1]
    )


def lqr_continuous(
    system: ContinuousSystem,
    reference: Reference,
    control_cost: float | Float[Array, "m m"],
    *,
    period: float,
) -> ContinuousFeedback:
    """At each moment, the gain that would be optimal if target and weight stayed for ever; no feed-forward.

    targets[t] and weights[t] hold for the t-th period [s]; the last of each is not used. A constant target mu
    is reached only if it is at rest, A mu = 0; any other leaves the error (B K - A)^-1 A mu.
    Costs one algebraic Riccati equation for each distinct weight. effort as in `track_continuous`.
    Raises: InvalidInput and NotPositiveDefinite, as `regulate` does.
    Source: the thesis, equations 3.47 and 3.50; the solver is scipy.linalg.solve_continuous_are.
    """
    R = _validate_problem(system, reference, control_cost, period)
    weights, targets = reference.weights[:-1], reference.targets[:-1]
    first_indices, inverse = unique_weights(weights)
    gains = np.stack([_stabilising_gain(system, weights[t], R, f"weights[{t}]") for t in first_indices])[
        inverse
    ]
    first_indices, inverse = unique_weights(_stack_weights_and_targets(weights, targets))
    closed_loops = np.stack(
        [_closed_loop_transition(system, gains[t], targets[t], period) for t in first_indices]
    )[inverse]
    feedforwards = np.zeros(gains.shape[:2])
    return ContinuousFeedback(
        system, reference, float(period), gains, feedforwards, closed_loops[:, :, :-1], closed_loops[:, :, -1]
    )


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
    flows: list[HamiltonianFlow], end: Float[Array, "w w"]
) -> tuple[Float[Array, "S w-1 w"], Float[Array, "S w-1 w"]]:
    """For each period, [P, -s] at its beginning and [transition, offset] over it, in the closed loop."""
    value_matrices, closed_loops = [], []
    value = end  # [P, -s; -s^T, .]: the price of (x, 1)
    for period_flow in reversed(flows):
        closed_loop = np.linalg.solve(np.eye(len(end)) + period_flow.G @ value, period_flow.A)
        value = symmetric_part(period_flow.Q + period_flow.A.T @ value @ closed_loop)
        value_matrices.append(value[:-1])
        closed_loops.append(closed_loop[:-1])
    return np.stack(value_matrices[::-1]), np.stack(closed_loops[::-1])


def _period_flows(
    system: ContinuousSystem, reference: Reference, R: Float[Array, "m m"], period: float
) -> list[HamiltonianFlow]:
    """The flow of (x, 1) over each period; computed once for each distinct target with its weight."""
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
) -> HamiltonianFlow:
    """The flow of (x, 1), found as the flow of (x - target, 1): a far target costs no digits there."""
    zero = np.zeros_like(target)
    drift = np.vstack([np.hstack([A, (A @ target)[:, None]]), np.zeros(len(A) + 1)])
    centred = hamiltonian_flow(drift, _border_matrix(G, zero, 0.0), _border_matrix(weight, zero, 0.0), period)
    uncentre, centre = np.eye(len(drift)), np.eye(len(drift))
    uncentre[:-1, -1], centre[:-1, -1] = target, -target
    return HamiltonianFlow(uncentre @ centred.A @ centre, centred.G, centre.T @ centred.Q @ centre)


def _stack_weights_and_targets(
    weights: Float[Array, "S n n"], targets: Float[Array, "S n"]
) -> Float[Array, "S n n+1"]:
    return np.concatenate([weights, targets[:, :, None]], axis=2)


def _homogeneous_cost(weight: Float[Array, "n n"], target: Float[Array, " n"]) -> Float[Array, "n+1 n+1"]:
    """|x - target|^2 in weight, as a quadratic form of (x, 1)."""
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
        with np.errstate(all="ignore"):  # what SciPy makes of a hopeless problem is judged by its gain
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
    """[transition, offset] over a period under  u = -K (x - target)."""
    pull = system.B @ K
    loop = discretise(ContinuousSystem(system.A - pull, (pull @ target)[:, None]), period)
    return np.hstack([loop.A, loop.B])
