"""Linear quadratic tracking and regulation in discrete time."""

import numpy as np

from pilotfish.control.feedback import Feedback
from pilotfish.control.reference import Reference, unique_weights
from pilotfish.control.systems import DiscreteSystem, LinearSystem, TimeVaryingSystem
from pilotfish.control.validation import (
    control_cost_matrix,
    require_period,
    require_reference,
    require_same_period,
    require_steps,
    require_system,
)
from pilotfish.errors import InvalidInput
from pilotfish.kernels import riccati
from pilotfish.types import Array, Float
from pilotfish.validation import require_type

MAX_COST_RATIO = 1e24  # beyond, SciPy's Riccati solvers lose every digit


def validate_problem(
    system: DiscreteSystem, reference: Reference, control_cost: float | Float[Array, "m m"]
) -> Float[Array, "m m"]:
    """The door of every discrete solver: its three arguments agree, and R is returned."""
    require_type(system, "system", (LinearSystem, TimeVaryingSystem), "see pf.control.double_integrator")
    require_type(reference, "reference", Reference, "pf.plan makes one from an adapted skill")
    require_system(system.A, system.B, rank=3 if isinstance(system, TimeVaryingSystem) else 2)
    require_period(system.period)
    require_same_period(reference.period, system.period)
    require_reference(reference.targets, reference.weights, system.B.shape[-2])
    require_steps(system.A, len(reference.targets))
    return control_cost_matrix(control_cost, system.B.shape[-1])


def track(
    system: DiscreteSystem, reference: Reference, control_cost: float | Float[Array, "m m"]
) -> Feedback:
    """The feedback that makes  sum_t |x_t - targets[t]|^2 in weights[t]  +  sum_t |u_t|^2 in effort  least.

    It looks ahead over the whole horizon: the motion leaves a target before the next one begins. Weak weights
    buy compliance; the robot yields where demonstrations disagreed and insists where they agreed.
    control_cost is R, or the number that multiplies the identity.
    Raises: InvalidInput, when shapes disagree, a number is not finite or control_cost is not positive;
    NotPositiveDefinite, when a weight or the effort matrix has a negative eigenvalue.
    Source: the thesis, equations 3.52-3.54, with the feed-forward's second mean at t + 1, where it prints t.
    """
    R = validate_problem(system, reference, control_cost)
    varies = isinstance(system, TimeVaryingSystem)
    A, B = (system.A, system.B) if varies else (system.A[None], system.B[None])
    solution = riccati(*map(_contiguous_float64, (A, B, reference.weights, reference.targets, R)))
    if not (np.isfinite(solution.gains).all() and np.isfinite(solution.feedforwards).all()):
        raise InvalidInput(
            "the gains are not finite: over this horizon the system outgrows what numbers can hold; no input "
            "reaches one of its growing motions, or the horizon is too long"
        )
    return Feedback(system, reference, solution.gains, solution.feedforwards)


def lqr(system: LinearSystem, reference: Reference, control_cost: float | Float[Array, "m m"]) -> Feedback:
    """At each step, the gain that would be optimal if its target and weight stayed for ever; no feed-forward.

    It does not look ahead: the motion turns to a target when that begins. A constant target mu is reached
    only if it is at rest, A mu = mu; any other leaves the error (I - A + B K)^-1 (A - I) mu. The double
    integrator asked to be at p with velocity v comes to rest (K^P)^-1 K^V v past p.
    Costs one algebraic Riccati equation for each distinct weight. effort as in `track`.
    Raises: InvalidInput and NotPositiveDefinite as `track` does; InvalidInput too, when a motion that does
    not die out by itself has no price or is out of the inputs' reach: then no such gain exists.
    Source: the thesis, equation 3.56; the solver is scipy.linalg.solve_discrete_are.
    """
    R = validate_problem(system, reference, control_cost)
    require_type(system, "system", LinearSystem, "what varies has no steady gain: use track")
    weights = reference.weights[:-1]
    first_indices, inverse = unique_weights(weights)
    gains = np.stack([_stabilising_gain(system, weights[t], R, f"weights[{t}]") for t in first_indices])[
        inverse
    ]
    return Feedback(system, reference, gains, np.zeros(gains.shape[:2]))


def _stabilising_gain(
    system: LinearSystem, weight: Float[Array, "n n"], R: Float[Array, "m m"], name: str
) -> Float[Array, "m n"]:
    from scipy.linalg import solve_discrete_are  # slow to import

    weight, R = normalise_costs(weight, R, name)
    A, B = system.A, system.B
    try:
        with np.errstate(all="ignore"):  # what SciPy makes of a hopeless problem is judged by its gain
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
    """Return weight and effort divided by one power of two, so that the largest control_cost is from 1/2 to 1.

    The gain stays the same, and SciPy's solvers, which depend on the scale, find it.

    Raises:
        InvalidInput: If the larger is more than 1e24 times the other; a zero weight is not compared.
    """
    largest, price = float(np.abs(weight).max()), float(np.abs(R).max())
    if largest > 0.0 and not price / MAX_COST_RATIO <= largest <= price * MAX_COST_RATIO:
        raise InvalidInput(
            f"{name} is up to {largest:.3g} and control_cost up to {price:.3g}, expected them at most a factor of "
            f"{MAX_COST_RATIO:g} apart: beyond, no steady gain can be computed; choose weight and control_cost in "
            "the same units"
        )
    exponent = int(np.frexp(price)[1])
    return np.ldexp(weight, -exponent), np.ldexp(R, -exponent)


def stabilisability_error(name: str) -> InvalidInput:
    return InvalidInput(
        f"{name} has no stabilising gain: some motion that does not die out by itself has no price, or no"
        " input reaches it; expected a weight on every position, such as the covariance_regularisation that a plan adds"
    )


def symmetric_part(matrix: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """All that a quadratic form sees of a matrix; SciPy refuses the rounding that our door lets pass."""
    symmetric: Float[Array, "n n"] = 0.5 * (matrix + matrix.T)
    return symmetric


def _contiguous_float64(array: Array) -> Array:
    return np.ascontiguousarray(array, dtype=np.float64)  # a reference may be a broadcast view
