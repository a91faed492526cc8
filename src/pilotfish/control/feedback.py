"""Feedback controllers that tracking returns, and the motions that they make."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control.reference import Reference
from pilotfish.control.systems import ContinuousSystem, DiscreteSystem
from pilotfish.control.validation import position_count, require_start
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """States of a system and the inputs between them.

    Attributes:
        x: States, a period apart.
        u: Input at the beginning of each period.
        period: Time between two states [s].
    """

    x: Float[Array, "T n"]
    u: Float[Array, "T-1 m"]
    period: float


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Feedback:
    """Controller u[t] = feedforwards[t] - gains[t] (x[t] - targets[t]) over S = T - 1 periods.

    In discrete time u is held for a period. In continuous time gains and feedforwards are those at the
    beginning of a period and change within it; the closed loop is then integrated exactly.

    Attributes:
        system: Dynamics.
        reference: Targets and weights at T steps.
        period: Duration of a period [s].
        gains: Gain of each period, or at its beginning.
        feedforwards: Input at the target in each period, or at its beginning.
        closed_loops: In continuous time, the matrix and the offset (last column) that map the state over each
            period; None in discrete time.
    """

    system: DiscreteSystem | ContinuousSystem
    reference: Reference
    period: float
    gains: Float[Array, "S m n"]
    feedforwards: Float[Array, "S m"]
    closed_loops: Float[Array, "S n _"] | None = None

    @property
    def stiffness(self) -> Float[Array, "S m half"]:
        """K^P: gain on positions, the first half of a second-order state.

        Raises:
            InvalidInput: If the state has an odd number of entries.
        """
        return self.gains[:, :, : position_count(self.gains)]

    @property
    def damping(self) -> Float[Array, "S m half"]:
        """K^V: gain on velocities, the second half of a second-order state.

        Raises:
            InvalidInput: If the state has an odd number of entries.
        """
        return self.gains[:, :, position_count(self.gains) :]

    def command(self, t: int, x: Float[Array, " n"]) -> Float[Array, " m"]:
        """Return the input at the beginning of a period.

        Args:
            t: Period, from 0.
            x: State at its beginning.
        """
        command: Float[Array, " m"] = self.feedforwards[t] - self.gains[t] @ (x - self.reference.targets[t])
        return command

    def rollout(self, start: Float[Array, " n"]) -> Motion:
        """Return the motion of the system under this feedback, exact in continuous time too.

        Args:
            start: First state.

        Raises:
            InvalidInput: If start is not a finite state of the system.
        """
        S, m, n = self.gains.shape
        require_start(start, n)
        A, B = np.broadcast_to(self.system.A, (S, n, n)), np.broadcast_to(self.system.B, (S, n, m))
        x, u = np.empty((S + 1, n)), np.empty((S, m))
        x[0] = start
        for t in range(S):
            u[t] = self.command(t, x[t])
            if self.closed_loops is None:
                x[t + 1] = A[t] @ x[t] + B[t] @ u[t]
            else:
                x[t + 1] = self.closed_loops[t, :, :-1] @ x[t] + self.closed_loops[t, :, -1]
        return Motion(x, u, self.period)
