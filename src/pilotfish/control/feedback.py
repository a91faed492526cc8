"""The controller that tracking returns, and the motion it makes."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control.reference import Reference
from pilotfish.control.systems import ContinuousSystem, DiscreteSystem, broadcast_system
from pilotfish.control.validation import position_count, require_start
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """States a period [s] apart, and the input at the beginning of each of the periods between them."""

    x: Float[Array, "T n"]
    u: Float[Array, "T-1 m"]
    period: float


@dataclass(frozen=True, slots=True, eq=False)
class Feedback:
    """The controller  u_t = feedforwards[t] - gains[t] (x_t - targets[t]),  over S = T - 1 periods."""

    system: DiscreteSystem
    reference: Reference
    gains: Float[Array, "S m n"]
    feedforwards: Float[Array, "S m"]

    @property
    def stiffness(self) -> Float[Array, "S m half"]:
        """K^P: the gain on positions, the first half of a second-order state.

        Raises: InvalidInput, when the state has no halves.
        """
        return self.gains[:, :, : position_count(self.gains)]

    @property
    def damping(self) -> Float[Array, "S m half"]:
        """K^V: the gain on velocities, the second half of a second-order state.

        Raises: InvalidInput, when the state has no halves.
        """
        return self.gains[:, :, position_count(self.gains) :]

    def command(self, t: int, x: Float[Array, " n"]) -> Float[Array, " m"]:
        """The input to hold during the t-th period, from the state at its beginning."""
        command: Float[Array, " m"] = self.feedforwards[t] - self.gains[t] @ (x - self.reference.targets[t])
        return command

    def rollout(self, start: Float[Array, " n"]) -> Motion:
        """How the system moves from start under this feedback.

        Raises: InvalidInput, when start is not a finite state of the system.
        """
        S, m, n = self.gains.shape
        require_start(start, n)
        system = broadcast_system(self.system, S)
        x, u = np.empty((S + 1, n)), np.empty((S, m))
        x[0] = start
        for t in range(S):
            u[t] = self.command(t, x[t])
            x[t + 1] = system.A[t] @ x[t] + system.B[t] @ u[t]
        return Motion(x, u, self.system.period)


@dataclass(frozen=True, slots=True, eq=False)
class ContinuousFeedback:
    """The controller  u = feedforwards[t] - gains[t] (x - targets[t])  as period t begins.

    Gains and feed-forwards change with time inside the period [s], which is integrated already: under them
    the state moves to  transitions[t] x + offsets[t].
    """

    system: ContinuousSystem
    reference: Reference
    period: float
    gains: Float[Array, "S m n"]
    feedforwards: Float[Array, "S m"]
    transitions: Float[Array, "S n n"]
    offsets: Float[Array, "S n"]

    @property
    def stiffness(self) -> Float[Array, "S m half"]:
        """K^P: the gain on positions, the first half of a second-order state.

        Raises: InvalidInput, when the state has no halves.
        """
        return self.gains[:, :, : position_count(self.gains)]

    @property
    def damping(self) -> Float[Array, "S m half"]:
        """K^V: the gain on velocities, the second half of a second-order state.

        Raises: InvalidInput, when the state has no halves.
        """
        return self.gains[:, :, position_count(self.gains) :]

    def command(self, t: int, x: Float[Array, " n"]) -> Float[Array, " m"]:
        """The input at the moment the t-th period begins, from the state there."""
        command: Float[Array, " m"] = self.feedforwards[t] - self.gains[t] @ (x - self.reference.targets[t])
        return command

    def rollout(self, start: Float[Array, " n"]) -> Motion:
        """How the system moves from start under this feedback, which acts without pause; exact.

        Raises: InvalidInput, when start is not a finite state of the system.
        """
        S, m, n = self.gains.shape
        require_start(start, n)
        x, u = np.empty((S + 1, n)), np.empty((S, m))
        x[0] = start
        for t in range(S):
            u[t] = self.command(t, x[t])
            x[t + 1] = self.transitions[t] @ x[t] + self.offsets[t]
        return Motion(x, u, self.period)
