"""Random tracking problems, and what a motion costs by definition."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from pilotfish.control import LinearSystem, Reference, TimeVaryingSystem


@dataclass(frozen=True)
class Problem:
    """All that a tracker is asked, and where the motion starts."""

    system: LinearSystem | TimeVaryingSystem
    reference: Reference
    control_cost: np.ndarray
    start: np.ndarray

    def simulate(self, u: np.ndarray) -> np.ndarray:
        """The states that these inputs lead through, period by period."""
        varies = isinstance(self.system, TimeVaryingSystem)
        x = [self.start]
        for t, push in enumerate(u):
            A, B = (self.system.A[t], self.system.B[t]) if varies else (self.system.A, self.system.B)
            x.append(A @ x[-1] + B @ push)
        return np.array(x)

    def cost(self, u: np.ndarray) -> float:
        """Sum over steps of |x - target|^2 in weight, and over inputs of |u|^2 in effort."""
        errors = self.simulate(u) - self.reference.targets
        price = sum(e @ W @ e for e, W in zip(errors, self.reference.weights, strict=True))
        return float(price + sum(push @ self.control_cost @ push for push in u))


def definite(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Symmetric positive definite matrices of moderate condition."""
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(shape[-1])


def steps(rng: np.random.Generator, n: int, T: int) -> Reference:
    """A step-wise reference: targets change every three steps, weights every other, and both come back."""
    target, weight = np.repeat(rng.integers(4, size=T), 3)[:T], np.repeat(rng.integers(4, size=T), 2)[:T]
    return Reference(rng.normal(size=(4, n))[target], definite(rng, 4, n)[weight])


@pytest.fixture
def random_problem(rng: np.random.Generator) -> Callable[..., Problem]:
    def make(n: int, m: int, T: int, *, varying: bool = False) -> Problem:
        shape = (T - 1,) if varying else ()
        A = np.eye(n) + 0.2 * rng.normal(size=(*shape, n, n))
        A /= np.abs(
            np.linalg.eigvals(A)
        ).max()  # left alone it stays; powers that explode cost the oracle digits
        B = rng.normal(size=(*shape, n, m))
        system = TimeVaryingSystem(A, B, 0.1) if varying else LinearSystem(A, B, 0.1)
        weights = definite(rng, T, n)
        weights[rng.integers(T)] = 0.0  # a step that is left free
        rank_one = rng.normal(size=n)
        weights[rng.integers(T)] = np.outer(rank_one, rank_one)
        reference = Reference(rng.normal(size=(T, n)), weights)
        return Problem(system, reference, definite(rng, m), rng.normal(size=n))

    return make


@pytest.fixture
def stepwise(rng: np.random.Generator) -> Callable[[int, int], Reference]:
    return lambda n, T: steps(rng, n, T)
