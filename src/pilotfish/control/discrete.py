"""Linear quadratic tracking (LQT) and regulation (LQR) in discrete time.

Problem. A system x[t+1] = A x[t] + B u[t] follows targets r_t with weights Q_t at minimum cost

    sum over t < T of (x_t - r_t)' Q_t (x_t - r_t)  +  sum over t < T - 1 of u_t' R u_t,

where R is the control cost. If the targets are the means of Gaussians and the weights their precision
matrices, this is minimum intervention control: a deviation costs little where demonstrations varied, and much
where they agreed. A small weight makes the robot compliant.

LQT (`track`). The cost-to-go from step t is quadratic, (x - r_t)' P_t (x - r_t) + 2 d_t' (x - r_t) + const.
The Riccati recursion runs backward from P = Q_{T-1}, d = 0:

    H   = R + B' P_{t+1} B,                 g_t = P_{t+1} (A r_t - r_{t+1}) + d_{t+1}
    K_t = H^-1 B' P_{t+1} A,                k_t = -H^-1 B' g_t
    P_t = Q_t + A' P_{t+1} (A - B K_t),     d_t = (A - B K_t)' g_t

The optimal input is u_t = k_t - K_t (x_t - r_t) for any initial state. The feedforward k_t depends on later
targets: the motion leaves a target before the next one begins. The kernel `riccati` computes the recursion.

LQR (`lqr`). With an infinite horizon and a constant weight, P and K solve the algebraic Riccati equation
P = Q + A' P (A - B K). There is one gain per distinct weight and no feedforward, so that the motion turns to
a target only when it begins.

Invariants. `track` agrees with `solve_batch`. P_t is symmetric positive semidefinite. Scaling all weights and
R by one number changes neither gains nor feedforwards. For T to infinity the gains of `track` tend to those
of `lqr`.

Keep in step: the NumPy reference and the C++ kernel of `riccati` use the same recursion in this form.
"""

import numpy as np

from pilotfish.control.feedback import Feedback
from pilotfish.control.reference import Reference, unique_weights
from pilotfish.control.systems import DiscreteSystem, LinearSystem, TimeVaryingSystem
from pilotfish.control.validation import (
    control_cost_matrix,
    require_reference,
    require_same_period,
    require_steps,
    require_system,
)
from pilotfish.errors import InvalidInput
from pilotfish.kernels import riccati
from pilotfish.types import Array, Float
from pilotfish.validation import require_period, require_type

MAX_COST_RATIO = 1e24  # beyond it, SciPy's Riccati solvers lose every digit


def validate_problem(
    system: DiscreteSystem, reference: Reference, control_cost: float | Float[Array, "m m"]
) -> Float[Array, "m m"]:
    """Check the arguments of a discrete solver and return R."""
    require_type(system, "system", (LinearSystem, TimeVaryingSystem), "see pf.control.double_integrator")
    require_type(reference, "reference", Reference, "pf.plan makes one from an adapted skill")
    require_system(system.A, system.B, rank=system.rank)
    require_period(system.period)
    require_same_period(reference.period, system.period)
    require_reference(reference.targets, reference.weights, system.B.shape[-2])
    require_steps(system.A, len(reference.targets))
    return control_cost_matrix(control_cost, system.B.shape[-1])


def track(
    system: DiscreteSystem, reference: Reference, control_cost: float | Float[Array, "m m"]
) -> Feedback:
    """Compute the feedback that tracks a reference at minimum quadratic cost (finite-horizon LQT).

    Costs O(T (n^3 + m^3)) time.

    Args:
        system: Dynamics over each period.
        reference: Targets and weights at T steps.
        control_cost: R, symmetric positive definite, or the number that multiplies the identity; larger
            values give lower gains.

    Returns:
        Gains and feedforwards of T - 1 periods.

    Raises:
        InvalidInput: If shapes differ, a number is not finite, or control_cost is not positive.
        NotPositiveDefinite: If a weight or R has a negative eigenvalue.

    Example:
        >>> import numpy as np
        >>> from pilotfish.control import Reference, double_integrator, track
        >>> reference = Reference(np.zeros((50, 2)), np.tile(np.diag([1.0, 0.0]), (50, 1, 1)))
        >>> track(double_integrator(1, period=0.1), reference, control_cost=0.01).gains.shape
        (49, 1, 2)

    Source:
        Tanwani 2018, equations 3.52-3.54; the second mean of the feedforward is that of t + 1, where the
        thesis prints t.
    """
    R = validate_problem(system, reference, control_cost)
    A, B = (matrices.reshape(-1, *matrices.shape[-2:]) for matrices in (system.A, system.B))
    gains, feedforwards, *_ = riccati(
        *map(_contiguous_float64, (A, B, reference.weights, reference.targets, R))
    )
    if not (np.isfinite(gains).all() and np.isfinite(feedforwards).all()):
        raise InvalidInput(
            "the gains are not finite: the state overflows float64 over this horizon; an unstable mode "
            "cannot be controlled, or the horizon is too long"
        )
    return Feedback(system, reference, system.period, gains, feedforwards)


def lqr(system: LinearSystem, reference: Reference, control_cost: float | Float[Array, "m m"]) -> Feedback:
    """Compute at each step the infinite-horizon LQR gain for its weight, without feedforward.

    The motion turns to a target only when it begins. A constant target r is reached only if it is an
    equilibrium, A r = r; otherwise the error (I - A + B K)^-1 (A - I) r remains. A double integrator with
    target position p and velocity v comes to rest at p + (K^P)^-1 K^V v.

    Costs one algebraic Riccati equation per distinct weight.

    Args:
        system: Time-invariant dynamics.
        reference: Targets and weights at T steps; the last ones are not used.
        control_cost: R, or the number that multiplies the identity.

    Returns:
        Gains of T - 1 periods, and feedforwards of zero.

    Raises:
        InvalidInput: As `track`, and if a mode that is not stable has no cost or cannot be controlled.
        NotPositiveDefinite: As `track`.

    Source:
        Tanwani 2018, equation 3.56; the solver is scipy.linalg.solve_discrete_are.
    """
    R = validate_problem(system, reference, control_cost)
    require_type(system, "system", LinearSystem, "a time-varying system has no constant gain: use track")
    weights = reference.weights[:-1]
    first_indices, inverse = unique_weights(weights)
    gains = np.stack([_stabilising_gain(system, weights[t], R, f"weights[{t}]") for t in first_indices])
    gains = gains[inverse]
    return Feedback(system, reference, system.period, gains, np.zeros(gains.shape[:2]))


def _stabilising_gain(
    system: LinearSystem, weight: Float[Array, "n n"], R: Float[Array, "m m"], name: str
) -> Float[Array, "m n"]:
    from scipy.linalg import solve_discrete_are  # slow to import

    weight, R = normalise_costs(weight, R, name)
    A, B = system.A, system.B
    try:
        with np.errstate(all="ignore"):  # a bad solution is recognised by its gain
            P = solve_discrete_are(A, B, symmetric_part(weight), symmetric_part(R))
            K: Float[Array, "m n"] = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
            stable = np.abs(np.linalg.eigvals(A - B @ K)).max() < 1
    except (np.linalg.LinAlgError, ValueError) as error:
        raise stabilisability_error(name) from error
    if not stable:
        raise stabilisability_error(name)
    return K


def normalise_costs(
    weight: Float[Array, "n n"], R: Float[Array, "m m"], name: str
) -> tuple[Float[Array, "n n"], Float[Array, "m m"]]:
    """Divide weight and R by one power of two, so that the largest entry of R is from 1/2 to 1.

    The gain stays the same; SciPy's solvers depend on the scale.

    Raises:
        InvalidInput: If the larger is more than 1e24 times the other; a zero weight is not compared.
    """
    largest, cost = float(np.abs(weight).max()), float(np.abs(R).max())
    if largest > 0.0 and not cost / MAX_COST_RATIO <= largest <= cost * MAX_COST_RATIO:
        raise InvalidInput(
            f"{name} is up to {largest:.3g} and control_cost up to {cost:.3g}, expected a ratio of at most "
            f"{MAX_COST_RATIO:g}: beyond it, no gain can be computed; choose both in the same units"
        )
    exponent = int(np.frexp(cost)[1])
    return np.ldexp(weight, -exponent), np.ldexp(R, -exponent)


def stabilisability_error(name: str) -> InvalidInput:
    """Return the error of a weight without a stabilising gain."""
    return InvalidInput(
        f"{name} has no stabilising gain: a mode that is not stable has no cost, or no input controls it; "
        "expected a weight on every position, such as the covariance_regularisation of a plan"
    )


def symmetric_part(matrix: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """Return the symmetric part; SciPy refuses rounding errors that `require_reference` accepts."""
    symmetric: Float[Array, "n n"] = 0.5 * (matrix + matrix.T)
    return symmetric


def _contiguous_float64(array: Array) -> Array:
    return np.ascontiguousarray(array, dtype=np.float64)  # a reference may be a broadcast view
