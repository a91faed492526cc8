"""Linear quadratic tracking in NumPy, written down as a textbook has it: Anderson & Moore 1990, chapter 4."""

from functools import partial
from pathlib import Path

import numpy as np
from prepared import CommandResult, Prepared
from problems import Floats, Tracking


def print_note() -> str:
    return ""


def lqt(A: Floats, B: Floats, Q: Floats, z: Floats, R: Floats) -> tuple[Floats, Floats]:
    """u[t] = k[t] - K[t] x[t] makes  sum (x - z)^T Q (x - z) + sum u^T R u  least: dynamic programming."""
    T, (n, m) = len(z), B.shape
    K, k = np.empty((T - 1, m, n)), np.empty((T - 1, m))
    P, s = Q[-1], Q[-1] @ z[-1]
    for t in range(T - 2, -1, -1):
        S = R + B.T @ P @ B
        K[t] = np.linalg.solve(S, B.T @ P @ A)
        k[t] = np.linalg.solve(S, B.T @ s)
        closed = A - B @ K[t]
        s = closed.T @ s + Q[t] @ z[t]
        P = Q[t] + A.T @ P @ closed
    return K, k


def tracker(folder: Path) -> Prepared:
    problem = Tracking.load(folder)
    run = partial(lqt, problem.A, problem.B, problem.weights, problem.targets, problem.control_cost)
    return Prepared(run, lambda law: CommandResult(float(np.sqrt((law[0] ** 2).sum() + (law[1] ** 2).sum()))))
