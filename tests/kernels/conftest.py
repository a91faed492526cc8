"""Random models for the kernels, and both implementations of every kernel."""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest

from pilotfish.kernels import Emissions, reference


@dataclass(frozen=True)
class Case:
    """Arguments of e_step."""

    x: np.ndarray
    lengths: np.ndarray
    initial: np.ndarray
    transitions: np.ndarray
    means: np.ndarray
    precision_cholesky: np.ndarray

    @property
    def emissions(self) -> Emissions:
        return Emissions(self.means, self.precision_cholesky)

    @property
    def arguments(self) -> tuple[object, ...]:
        return self.x, self.lengths, self.initial, self.transitions, self.emissions


@pytest.fixture(scope="session")
def compiled() -> ModuleType:
    """Return the compiled kernels; skip the test if they were not built."""
    try:
        return importlib.import_module("pilotfish.kernels.compiled")
    except ImportError as reason:
        pytest.skip(f"the compiled kernels are missing: {reason}")


@pytest.fixture(params=["reference", "compiled"])
def kernels(request: pytest.FixtureRequest) -> ModuleType:
    """Return the NumPy references, then the compiled kernels."""
    return reference if request.param == "reference" else request.getfixturevalue("compiled")


@pytest.fixture
def chain(rng: np.random.Generator) -> Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return log-emissions, initial and transition probabilities, of which a fraction `zeros` is zero."""

    def draw(T: int, K: int, spread: float = 1.0, zeros: float = 0.0) -> tuple[np.ndarray, ...]:
        transitions = rng.dirichlet(np.ones(K), size=K) * (rng.random((K, K)) >= zeros)
        initial = rng.dirichlet(np.ones(K)) * (rng.random(K) >= zeros)
        initial[rng.integers(K)] += 0.1
        return spread * rng.normal(size=(T, K)), initial, transitions

    return draw


@pytest.fixture
def case(rng: np.random.Generator) -> Callable[..., Case]:
    """Return a model and demonstrations of given lengths near its means."""

    def draw(P: int, lengths: list[int], D: int, K: int) -> Case:
        means = rng.normal(size=(P, K, D))
        precision_cholesky = np.tril(0.2 * rng.normal(size=(P, K, D, D)), -1) + np.eye(D) * rng.uniform(
            0.5, 2.0, D
        )
        x = means[:, rng.integers(K, size=sum(lengths))] + rng.normal(size=(P, sum(lengths), D))
        initial, transitions = rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K)
        return Case(x, np.array(lengths), initial, transitions, means, precision_cholesky)

    return draw
