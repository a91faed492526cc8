"""A continuous tracking problem carried over a stretch of time, exactly."""

import math
from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class HamiltonianFlow:
    """What a stretch of time does to a state x and to its price p: half the gradient of the cost to go.

    x_after = A x_before - G p_after,    p_before = Q x_before + A^T p_after.
    """

    A: Float[Array, "n n"]
    G: Float[Array, "n n"]
    Q: Float[Array, "n n"]


def hamiltonian_flow(
    A: Float[Array, "n n"], G: Float[Array, "n n"], Q: Float[Array, "n n"], time: float
) -> HamiltonianFlow:
    """The Hamiltonian equations  dx/dt = A x - G p,  -dp/dt = Q x + A^T p  over some time [s].

    A matrix exponential carries them over a short stretch, which is then doubled: the exponential of a long
    one holds what grows beside what decays, and loses the latter.
    Source: Anderson 1978, Second-order convergent algorithms for the steady-state Riccati equation.
    """
    from scipy.linalg import expm  # slow to import

    n = len(A)
    hamiltonian = np.block([[A, -G], [-Q, -A.T]])
    doublings = math.ceil(math.log2(max(1.0, time * float(np.linalg.norm(hamiltonian, 1)))))
    short = expm(time / 2**doublings * hamiltonian)
    xp, px, pp = short[:n, n:], short[n:, :n], short[n:, n:]
    # p_after = px x + pp p is solved for p, and the flow is symplectic: x_after = pp^-T x + xp pp^-1 p_after
    result = HamiltonianFlow(
        np.linalg.solve(pp.T, np.eye(n)), -np.linalg.solve(pp.T, xp.T).T, -np.linalg.solve(pp, px)
    )
    for _ in range(doublings):
        result = _double_flow(result)
    return result


def _double_flow(f: HamiltonianFlow) -> HamiltonianFlow:
    """The flow over a stretch, then over an equal one: the price between them is eliminated."""
    between = np.eye(len(f.A)) + f.G @ f.Q
    A, G = np.linalg.solve(between, f.A), np.linalg.solve(between, f.G)
    return HamiltonianFlow(f.A @ A, f.G + f.A @ G @ f.A.T, f.Q + f.A.T @ f.Q @ A)
