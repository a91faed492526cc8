"""What the libraries are asked to solve: arrays in a folder of .npy files, the same for each of them."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class StoredProblem:
    """A problem that is kept in a folder, one array a file."""

    def save(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        for field in fields(self):
            np.save(folder / f"{field.name}.npy", getattr(self, field.name), allow_pickle=False)

    @classmethod
    def load(cls, folder: Path) -> Self:
        arrays = {f.name: np.load(folder / f"{f.name}.npy", allow_pickle=False) for f in fields(cls)}
        return cls(**{name: a.item() if a.ndim == 0 else a for name, a in arrays.items()})


@dataclass(frozen=True, slots=True, eq=False)
class Sequences(StoredProblem):
    """M sequences end to end, in one frame, and the hidden Markov model that learning begins from."""

    x: Floats  # (N, D)
    lengths: Integers  # (M,)
    initial: Floats  # (K,)
    transitions: Floats  # (K, K)
    means: Floats  # (K, D)
    covariances: Floats  # (K, D, D)
    iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class SegmentProblem(Sequences):
    """The same, of a hidden semi-Markov model: transitions has a zero diagonal."""

    durations: Floats  # (S, K), shares of 1 ... S steps


@dataclass(frozen=True, slots=True, eq=False)
class Poses(StoredProblem):
    """M movements of a tool, and the poses of P objects that it is seen from; quaternions are w x y z."""

    x: Floats  # (M, T, 7)
    objects: Floats  # (M, P, 7)
    states: int


@dataclass(frozen=True, slots=True, eq=False)
class FrameProblem(StoredProblem):
    """M demonstrations in the world and where P frames stood, to be learned with K states.

    joint is how all frames see a step, side by side. The mixture that its learning begins from is made of
    equal times, as pilotfish's own start is.
    """

    x: Floats  # (M, T, D)
    A: Floats  # (M, P, D, D)
    b: Floats  # (M, P, D)
    states: int
    iterations: int
    joint: Floats  # (M T, P D)
    weights: Floats  # (K,)
    means: Floats  # (K, P D)
    covariances: Floats  # (K, P D, P D)


@dataclass(frozen=True, slots=True, eq=False)
class Tracking(StoredProblem):
    """A step-wise reference for the system x' = A x + B u; begins[i] is the first step of target i."""

    A: Floats  # (n, n)
    B: Floats  # (n, m)
    weights: Floats  # (T, n, n)
    targets: Floats  # (T, n)
    control_cost: Floats  # (m, m)
    begins: Integers  # (K,)


@dataclass(frozen=True, slots=True, eq=False)
class Stream(StoredProblem):
    """N datapoints in the order in which they came, the cluster of each, and the scales of the generator."""

    x: Floats  # (N, D)
    labels: Integers  # (N,)
    clusters: int
    dimension: int  # of the largest subspace
    extent: float  # standard deviation along every direction of a subspace
    noise: float  # and along every column besides
    apart: float  # the least distance of two centres

    @property
    def radius(self) -> float:
        """How far a datapoint lies from its centre, root mean square."""
        return float(self.extent * np.sqrt(self.dimension))
