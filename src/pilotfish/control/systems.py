"""Linear systems: what an input does to the state, in one period or in one second."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control.validation import require_axes, require_period, require_system
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_type

MAX_GENERATOR_NORM = 1e15  # beyond, float64 leaves no right digit of a matrix exponential


@dataclass(frozen=True, slots=True, eq=False)
class LinearSystem:
    """One period [s] takes x to A x + B u, the input held throughout it."""

    A: Float[Array, "n n"]
    B: Float[Array, "n m"]
    period: float


@dataclass(frozen=True, slots=True, eq=False)
class TimeVaryingSystem:
    """The t-th period [s] takes x to A[t] x + B[t] u: S periods lie between S + 1 states."""

    A: Float[Array, "S n n"]
    B: Float[Array, "S n m"]
    period: float


@dataclass(frozen=True, slots=True, eq=False)
class ContinuousSystem:
    """The state changes at A x + B u a second."""

    A: Float[Array, "n n"]
    B: Float[Array, "n m"]


DiscreteSystem = LinearSystem | TimeVaryingSystem


def continuous_double_integrator(axes: int) -> ContinuousSystem:
    """A unit mass on each axis, pushed without friction: x holds positions then velocities, u accelerations.

    Raises: InvalidInput, when there is no axis.
    Source: the thesis, equation 3.44.
    """
    require_axes(axes)
    O, I = np.zeros((axes, axes)), np.eye(axes)  # noqa: E741 (the paper's letters)
    return ContinuousSystem(np.block([[O, I], [O, O]]), np.vstack([O, I]))


def double_integrator(axes: int, period: float) -> LinearSystem:
    """The unit mass on each axis, its acceleration held for a period [s]; exact.

    Raises: InvalidInput, when there is no axis or the period is not a positive time.
    Source: the thesis, equation 3.51.
    """
    require_axes(axes)
    require_period(period)
    O, I = np.zeros((axes, axes)), np.eye(axes)  # noqa: E741 (the paper's letters)
    A = np.block([[I, period * I], [O, I]])
    return LinearSystem(A, np.vstack([0.5 * period**2 * I, period * I]), period)


def discretise(system: ContinuousSystem, period: float) -> LinearSystem:
    """The same system seen every period [s], the input held in between; exact, by one matrix exponential.

    Raises: InvalidInput, when the system is not one or the period is not a positive time.
    Source: Van Loan 1978, Computing integrals involving the matrix exponential.
    """
    require_type(system, "system", ContinuousSystem, "see control.continuous_double_integrator")
    require_system(system.A, system.B, rank=2)
    require_period(period)
    from scipy.linalg import expm  # slow to import

    n, m = system.B.shape
    generator = np.zeros((n + m, n + m))
    generator[:n] = np.hstack([system.A, system.B])
    if (norm := float(np.abs(period * generator).sum(axis=0).max())) > MAX_GENERATOR_NORM:
        raise InvalidInput(
            f"within a period of {period} s the system moves its state by {norm:.3g} times itself, expected "
            f"at most {MAX_GENERATOR_NORM:g}; choose a shorter period"
        )
    with np.errstate(all="ignore"):
        flow = expm(period * generator)
    if not np.isfinite(flow).all():
        raise InvalidInput(
            f"within a period of {period} s the system outgrows what numbers can hold; choose a shorter one"
        )
    return LinearSystem(flow[:n, :n].copy(), flow[:n, n:].copy(), float(period))


def broadcast_system(system: DiscreteSystem, steps: int) -> TimeVaryingSystem:
    """The system written out period by period; views of A and B where it does not vary."""
    if isinstance(system, TimeVaryingSystem):
        return system
    A = np.broadcast_to(system.A, (steps, *system.A.shape))
    B = np.broadcast_to(system.B, (steps, *system.B.shape))
    return TimeVaryingSystem(A, B, system.period)
