"""Linear systems in discrete and in continuous time."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.control.validation import require_axes, require_system
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_period, require_type, shorten_repr

MAX_GENERATOR_NORM = 1e15  # beyond it, float64 leaves no correct digit of a matrix exponential


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LinearSystem:
    """Time-invariant system x[t+1] = A x[t] + B u[t], the input held for a period.

    Attributes:
        rank: Number of axes of A: 2.
        A: State matrix.
        B: Input matrix.
        period: Time between two states [s].
    """

    rank: ClassVar[int] = 2
    A: Float[Array, "n n"]
    B: Float[Array, "n m"]
    period: float

    def over(self, steps: int) -> "TimeVaryingSystem":
        """Return the system over a number of periods, as views of A and B.

        Args:
            steps: Number of periods.
        """
        A = np.broadcast_to(self.A, (steps, *self.A.shape))
        B = np.broadcast_to(self.B, (steps, *self.B.shape))
        return TimeVaryingSystem(A, B, self.period)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class TimeVaryingSystem:
    """Time-varying system x[t+1] = A[t] x[t] + B[t] u[t], with S periods between S + 1 states.

    Attributes:
        rank: Number of axes of A: 3.
        A: State matrix of each period.
        B: Input matrix of each period.
        period: Time between two states [s].
    """

    rank: ClassVar[int] = 3
    A: Float[Array, "S n n"]
    B: Float[Array, "S n m"]
    period: float

    def over(self, steps: int) -> "TimeVaryingSystem":
        """Return the system itself.

        Args:
            steps: Number of periods, S.
        """
        return self


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ContinuousSystem:
    """Continuous system dx/dt = A x + B u [1/s].

    Attributes:
        A: State matrix.
        B: Input matrix.
    """

    A: Float[Array, "n n"]
    B: Float[Array, "n m"]


DiscreteSystem = LinearSystem | TimeVaryingSystem


def continuous_double_integrator(axes: int) -> ContinuousSystem:
    """Return a unit mass on each axis; the state holds positions, then velocities, and u accelerations.

    Args:
        axes: Number of axes, at least 1.

    Raises:
        InvalidInput: If axes is below 1.

    Source:
        Tanwani 2018, equation 3.44.
    """
    require_axes(axes)
    O, I = np.zeros((axes, axes)), np.eye(axes)  # noqa: E741 (the paper's letters)
    return ContinuousSystem(np.block([[O, I], [O, O]]), np.vstack([O, I]))


def double_integrator(axes: int, period: float) -> LinearSystem:
    """Return a unit mass on each axis, with the acceleration held for a period; the discretisation is exact.

    Args:
        axes: Number of axes, at least 1.
        period: Time between two states [s], positive.

    Raises:
        InvalidInput: If axes is below 1, or the period is not a positive time.

    Source:
        Tanwani 2018, equation 3.51.
    """
    require_axes(axes)
    require_period(period)
    O, I = np.zeros((axes, axes)), np.eye(axes)  # noqa: E741 (the paper's letters)
    A = np.block([[I, period * I], [O, I]])
    return LinearSystem(A, np.vstack([0.5 * period**2 * I, period * I]), period)


def discretise(system: ContinuousSystem, period: float) -> LinearSystem:
    """Return the system sampled with the input held for each period, exactly, by one matrix exponential.

    Args:
        system: Continuous system.
        period: Time between two states [s], positive.

    Raises:
        InvalidInput: If an argument cannot be used, or the state grows by more than float64 can represent.

    Source:
        Van Loan 1978, Computing integrals involving the matrix exponential.
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
            f"A and B times the period of {period} s have norm {norm:.3g}, expected at most "
            f"{MAX_GENERATOR_NORM:g}; choose a shorter period"
        )
    with np.errstate(all="ignore"):
        transition = expm(period * generator)
    if not np.isfinite(transition).all():
        raise InvalidInput(
            f"the state overflows float64 within the period of {period} s; choose a shorter period"
        )
    return LinearSystem(transition[:n, :n].copy(), transition[:n, n:].copy(), float(period))
