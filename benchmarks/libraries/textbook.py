"""Linear-quadratic tracking in NumPy, as in a textbook: Anderson & Moore 1990, chapter 4."""

from functools import partial
from pathlib import Path

import numpy as np
from prepared import Answer, Prepared
from problems import Floats, Tracking


def remark() -> str:
    return ""


def lqt(A: Floats, B: Floats, Q: Floats, z: Floats, R: Floats) -> tuple[Floats, Floats]:
    """Return K and k of u[t] = k[t] - K[t] x[t], which minimises sum (x - z)^T Q (x - z) + sum u^T R u."""
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
    return Prepared(
        run, lambda control: Answer(float(np.sqrt((control[0] ** 2).sum() + (control[1] ** 2).sum())))
    )
