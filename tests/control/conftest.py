"""Random tracking problems, with their cost by definition."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from pilotfish.control import LinearSystem, Reference, TimeVaryingSystem


@dataclass(frozen=True)
class Problem:
    """Arguments of a solver, and the start of the motion."""

    system: LinearSystem | TimeVaryingSystem
    reference: Reference
    control_cost: np.ndarray
    start: np.ndarray

    def simulate(self, u: np.ndarray) -> np.ndarray:
        """Return the states that inputs lead to."""
        system, x = self.system.over(len(u)), [self.start]
        for t, u_t in enumerate(u):
            x.append(system.A[t] @ x[-1] + system.B[t] @ u_t)
        return np.array(x)

    def cost(self, u: np.ndarray) -> float:
        """Return the sum over steps of (x - r)' Q (x - r), and over inputs of u' R u."""
        errors = self.simulate(u) - self.reference.targets
        cost = sum(e @ W @ e for e, W in zip(errors, self.reference.weights, strict=True))
        return float(cost + sum(u_t @ self.control_cost @ u_t for u_t in u))


def positive_definite(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Return symmetric positive definite matrices of moderate condition."""
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(shape[-1])


def stepwise_reference(rng: np.random.Generator, n: int, T: int) -> Reference:
    """Return a step-wise reference: targets change every three steps, weights every two."""
    target, weight = np.repeat(rng.integers(4, size=T), 3)[:T], np.repeat(rng.integers(4, size=T), 2)[:T]
    return Reference(rng.normal(size=(4, n))[target], positive_definite(rng, 4, n)[weight])


@pytest.fixture
def random_problem(rng: np.random.Generator) -> Callable[..., Problem]:
    def make(n: int, m: int, T: int, *, varying: bool = False) -> Problem:
        shape = (T - 1,) if varying else ()
        A = np.eye(n) + 0.2 * rng.normal(size=(*shape, n, n))
        A /= np.abs(
            np.linalg.eigvals(A)
        ).max()  # spectral radius 1: growing powers cost the reference solution digits
        B = rng.normal(size=(*shape, n, m))
        system = TimeVaryingSystem(A, B, 0.1) if varying else LinearSystem(A, B, 0.1)
        weights = positive_definite(rng, T, n)
        weights[rng.integers(T)] = 0.0  # a free step
        rank_one = rng.normal(size=n)
        weights[rng.integers(T)] = np.outer(rank_one, rank_one)
        reference = Reference(rng.normal(size=(T, n)), weights)
        return Problem(system, reference, positive_definite(rng, m), rng.normal(size=n))

    return make


@pytest.fixture
def stepwise(rng: np.random.Generator) -> Callable[[int, int], Reference]:
    return lambda n, T: stepwise_reference(rng, n, T)
