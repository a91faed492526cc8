"""Linear quadratic tracking and regulation in continuous time; a target is held for a period."""

import numpy as np

from pilotfish.control.discrete import no_steady_gain, scaled_prices, symmetric_part
from pilotfish.control.doors import (
    effort_matrix,
    require_period,
    require_reference,
    require_same_period,
    require_system,
    require_terminal,
)
from pilotfish.control.feedback import ContinuousFeedback
from pilotfish.control.flow import Flow, flow
from pilotfish.control.reference import Reference, distinct
from pilotfish.control.systems import ContinuousSystem, discretise
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.types import Array, Float


def track_continuous(
    system: ContinuousSystem,
    reference: Reference,
    effort: float | Float[Array, "m m"],
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
    effort is R, or the number that multiplies the identity; running prices are per second.
    Raises: InvalidInput and NotPositiveDefinite, as `track` does.
    Source: the thesis, equations 3.45-3.46, where the first mean of the latter stands for its derivative.
    """
    R = _enter(system, reference, effort, period)
    end = np.zeros_like(system.A) if terminal is None else terminal
    require_terminal(end, len(system.A))
    with np.errstate(all="ignore"):
        prices, moves = _backwards(_flows(system, reference, R, period), _lifted(end, reference.targets[-1]))
        pull = np.linalg.solve(R, system.B.T) @ prices  # R^-1 B^T [P, -s]
    if not (np.isfinite(pull).all() and np.isfinite(moves).all()):
        raise InvalidInput(
            "the gains are not finite: within a period the system outgrows what numbers can hold; choose a "
            "shorter period, or weights and effort of more similar size"
        )
    gains, targets = pull[:, :, :-1], reference.targets[:-1]
    feedforwards = -pull[:, :, -1] - np.einsum("tmn,tn->tm", gains, targets)  # R^-1 B^T (s - P mu)
    return ContinuousFeedback(
        system, reference, float(period), gains, feedforwards, moves[:, :, :-1], moves[:, :, -1]
    )


def regulate_continuous(
    system: ContinuousSystem,
    reference: Reference,
    effort: float | Float[Array, "m m"],
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
    R = _enter(system, reference, effort, period)
    weights, targets = reference.weights[:-1], reference.targets[:-1]
    firsts, which = distinct(weights)
    gains = np.stack([_steady_gain(system, weights[t], R, f"weights[{t}]") for t in firsts])[which]
    firsts, which = distinct(_beside(weights, targets))
    moves = np.stack([_closed_loop(system, gains[t], targets[t], period) for t in firsts])[which]
    feedforwards = np.zeros(gains.shape[:2])
    return ContinuousFeedback(
        system, reference, float(period), gains, feedforwards, moves[:, :, :-1], moves[:, :, -1]
    )


def _enter(
    system: ContinuousSystem, reference: Reference, effort: float | Float[Array, "m m"], period: float
) -> Float[Array, "m m"]:
    require_kind("system", system, ContinuousSystem, "see control.continuous_double_integrator")
    require_kind("reference", reference, Reference, "pf.plan makes one from an adapted skill")
    require_system(system.A, system.B, rank=2)
    require_period(period)
    require_same_period(reference.period, period)
    require_reference(reference.targets, reference.weights, len(system.A))
    return effort_matrix(effort, system.B.shape[1])


def _backwards(
    flows: list[Flow], end: Float[Array, "w w"]
) -> tuple[Float[Array, "S w-1 w"], Float[Array, "S w-1 w"]]:
    """For each period, [P, -s] at its beginning and [transition, offset] over it, in the closed loop."""
    prices, moves = [], []
    value = end  # [P, -s; -s^T, .]: the price of (x, 1)
    for now in reversed(flows):
        move = np.linalg.solve(np.eye(len(end)) + now.G @ value, now.A)
        value = symmetric_part(now.Q + now.A.T @ value @ move)
        prices.append(value[:-1])
        moves.append(move[:-1])
    return np.stack(prices[::-1]), np.stack(moves[::-1])


def _flows(
    system: ContinuousSystem, reference: Reference, R: Float[Array, "m m"], period: float
) -> list[Flow]:
    """The flow of (x, 1) over each period; computed once for each distinct target with its weight."""
    G = system.B @ np.linalg.solve(R, system.B.T)
    weights, targets = reference.weights[:-1], reference.targets[:-1]
    firsts, which = distinct(_beside(weights, targets))
    flows = [_affine_flow(system.A, G, weights[t], targets[t], period) for t in firsts]
    return [flows[i] for i in which]


def _affine_flow(
    A: Float[Array, "n n"],
    G: Float[Array, "n n"],
    weight: Float[Array, "n n"],
    target: Float[Array, " n"],
    period: float,
) -> Flow:
    """The flow of (x, 1), found as the flow of (x - target, 1): a far target costs no digits there."""
    zero = np.zeros_like(target)
    drift = np.vstack([np.hstack([A, (A @ target)[:, None]]), np.zeros(len(A) + 1)])
    centred = flow(drift, _bordered(G, zero, 0.0), _bordered(weight, zero, 0.0), period)
    there, back = np.eye(len(drift)), np.eye(len(drift))
    there[:-1, -1], back[:-1, -1] = target, -target
    return Flow(there @ centred.A @ back, centred.G, back.T @ centred.Q @ back)


def _beside(weights: Float[Array, "S n n"], targets: Float[Array, "S n"]) -> Float[Array, "S n n+1"]:
    return np.concatenate([weights, targets[:, :, None]], axis=2)


def _lifted(weight: Float[Array, "n n"], target: Float[Array, " n"]) -> Float[Array, "n+1 n+1"]:
    """|x - target|^2 in weight, as a quadratic form of (x, 1)."""
    linear = -weight @ target
    return _bordered(weight, linear, -linear @ target)


def _bordered(block: Float[Array, "n n"], edge: Float[Array, " n"], corner: float) -> Float[Array, "n+1 n+1"]:
    return np.block([[block, edge[:, None]], [edge[None, :], np.array([[corner]])]])


def _steady_gain(
    system: ContinuousSystem, weight: Float[Array, "n n"], R: Float[Array, "m m"], name: str
) -> Float[Array, "m n"]:
    from scipy.linalg import solve_continuous_are  # slow to import

    weight, R = scaled_prices(weight, R, name)
    A, B = system.A, system.B
    try:
        with np.errstate(all="ignore"):  # what SciPy makes of a hopeless problem is judged by its gain
            P = solve_continuous_are(A, B, symmetric_part(weight), symmetric_part(R))
            K: Float[Array, "m n"] = np.linalg.solve(R, B.T @ P)
            stable = np.linalg.eigvals(A - B @ K).real.max() < 0
    except (np.linalg.LinAlgError, ValueError) as error:
        raise no_steady_gain(name) from error
    if not stable:
        raise no_steady_gain(name)
    return K


def _closed_loop(
    system: ContinuousSystem, K: Float[Array, "m n"], target: Float[Array, " n"], period: float
) -> Float[Array, "n n+1"]:
    """[transition, offset] over a period under  u = -K (x - target)."""
    pull = system.B @ K
    loop = discretise(ContinuousSystem(system.A - pull, (pull @ target)[:, None]), period)
    return np.hstack([loop.A, loop.B])
