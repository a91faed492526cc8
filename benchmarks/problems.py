"""Problems as arrays in folders of .npy files, the same for each library."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class StoredProblem:
    """Problem that is stored in a folder, one file for each array."""

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
    """M concatenated sequences in one frame, and the initial hidden Markov model."""

    x: Floats  # (N, D)
    lengths: Integers  # (M,)
    initial: Floats  # (K,)
    transitions: Floats  # (K, K)
    means: Floats  # (K, D)
    covariances: Floats  # (K, D, D)
    iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class SegmentProblem(Sequences):
    """The same for a hidden semi-Markov model: transitions has a zero diagonal."""

    durations: Floats  # (S, K), probabilities of 1 ... S steps


@dataclass(frozen=True, slots=True, eq=False)
class Poses(StoredProblem):
    """M movements of a tool, and the poses of P objects as frames; quaternions are w x y z."""

    x: Floats  # (M, T, 7)
    objects: Floats  # (M, P, 7)
    states: int


@dataclass(frozen=True, slots=True, eq=False)
class FrameProblem(StoredProblem):
    """M demonstrations in the world with P frames, for K states.

    joint holds the coordinates of a step in all frames side by side. The initial mixture is that of time
    bins, like pilotfish's own initialisation.
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
    """Step-wise reference for the system x' = A x + B u; begins[i] is the first step of target i."""

    A: Floats  # (n, n)
    B: Floats  # (n, m)
    weights: Floats  # (T, n, n)
    targets: Floats  # (T, n)
    control_cost: Floats  # (m, m)
    begins: Integers  # (K,)


@dataclass(frozen=True, slots=True, eq=False)
class Stream(StoredProblem):
    """N datapoints in order, the cluster of each, and the scales of the generator."""

    x: Floats  # (N, D)
    labels: Integers  # (N,)
    clusters: int
    dimension: int  # of the largest subspace
    extent: float  # standard deviation along each direction of a subspace
    noise: float  # standard deviation in every column
    separation: float  # least distance of two centres

    @property
    def radius(self) -> float:
        """Return the root-mean-square distance of a datapoint from its centre."""
        return float(self.extent * np.sqrt(self.dimension))
