"""Feedback controllers that tracking returns, and the motions that they make."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pilotfish.control.reference import Reference
from pilotfish.control.systems import ContinuousSystem, DiscreteSystem
from pilotfish.control.validation import position_count, require_start
from pilotfish.types import Array, Float


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


class _AffineFeedback:
    """Controller u[t] = feedforwards[t] - gains[t] (x[t] - targets[t]) over S = T - 1 periods."""

    __slots__ = ()
    reference: Reference
    gains: Array
    feedforwards: Array

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

    def _simulate(
        self, start: Float[Array, " n"], step: Callable[[int, Array, Array], Array], period: float
    ) -> Motion:
        """Roll out x[t+1] = step(t, x[t], u[t])."""
        S, m, n = self.gains.shape
        require_start(start, n)
        x, u = np.empty((S + 1, n)), np.empty((S, m))
        x[0] = start
        for t in range(S):
            u[t] = self.command(t, x[t])
            x[t + 1] = step(t, x[t], u[t])
        return Motion(x, u, period)


@dataclass(frozen=True, slots=True, eq=False)
class Feedback(_AffineFeedback):
    """Discrete controller u[t] = feedforwards[t] - gains[t] (x[t] - targets[t]), with u held for a period.

    Attributes:
        system: Dynamics over each period.
        reference: Targets and weights at T steps.
        gains: Gain of each of the S = T - 1 periods.
        feedforwards: Input at the target in each period.
    """

    system: DiscreteSystem
    reference: Reference
    gains: Float[Array, "S m n"]
    feedforwards: Float[Array, "S m"]

    def rollout(self, start: Float[Array, " n"]) -> Motion:
        """Return the motion of the system under this feedback.

        Args:
            start: First state.

        Raises:
            InvalidInput: If start is not a finite state of the system.
        """
        system = self.system.over(len(self.gains))
        return self._simulate(start, lambda t, x, u: system.A[t] @ x + system.B[t] @ u, system.period)


@dataclass(frozen=True, slots=True, eq=False)
class ContinuousFeedback(_AffineFeedback):
    """Continuous controller u = feedforwards[t] - gains[t] (x - targets[t]) at the beginning of period t.

    Within a period, gains and feedforwards change with time. The closed loop is integrated exactly: it maps
    the state to transitions[t] x + offsets[t].

    Attributes:
        system: Continuous dynamics.
        reference: Targets and weights at T steps.
        period: Duration of a period [s].
        gains: Gain at the beginning of each of the S = T - 1 periods.
        feedforwards: Input at the target at the beginning of each period.
        transitions: Matrix of the closed loop over each period.
        offsets: Offset of the closed loop over each period.
    """

    system: ContinuousSystem
    reference: Reference
    period: float
    gains: Float[Array, "S m n"]
    feedforwards: Float[Array, "S m"]
    transitions: Float[Array, "S n n"]
    offsets: Float[Array, "S n"]

    def rollout(self, start: Float[Array, " n"]) -> Motion:
        """Return the motion of the system under this feedback, without discretisation error.

        Args:
            start: First state.

        Raises:
            InvalidInput: If start is not a finite state of the system.
        """
        return self._simulate(start, lambda t, x, _: self.transitions[t] @ x + self.offsets[t], self.period)
