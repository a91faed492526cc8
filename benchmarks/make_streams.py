"""Streams whose segments come from clusters, each a random subspace, in a cycle or in random order."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from problems import Floats, Integers, Stream

NOISE = 0.2


@dataclass(frozen=True, slots=True)
class Shape:
    """Parameters of a stream.

    Attributes:
        columns: Number of columns.
        clusters: Number of clusters.
        min_dimension: Least dimension of a subspace.
        max_dimension: Largest dimension of a subspace.
        extent: Standard deviation along a subspace.
        separation: Least distance of two centres.
        correlation: Correlation between steps of a segment, along the subspace.
        shuffled: Sample the cluster of each step independently, instead of segments of 70 to 90 steps.
    """

    columns: int
    clusters: int
    min_dimension: int
    max_dimension: int
    extent: float
    separation: float
    correlation: float = 0.0
    shuffled: bool = False


# Near: clusters extend beyond the next centre, so that the nearest mean is often that of another cluster,
# about as often in 75 dimensions as in 14. Far: centres at least 4 sqrt(D) apart, as in section 5.7.
SHAPES = {
    "stream_14": Shape(14, 7, 2, 4, 3.0, 5.0, correlation=0.9),
    "stream_75": Shape(75, 7, 4, 8, 3.0, 4.0, correlation=0.9),
    "long_3": Shape(3, 20, 1, 2, 1.0, 4.0 * 3**0.5),
    "long_14": Shape(14, 20, 4, 4, 1.0, 4.0 * 14**0.5),
    "long_75": Shape(75, 20, 8, 8, 1.0, 4.0 * 75**0.5),
    "shuffled_3": Shape(3, 20, 1, 2, 1.0, 4.0 * 3**0.5, shuffled=True),
    "shuffled_14": Shape(14, 20, 4, 4, 1.0, 4.0 * 14**0.5, shuffled=True),
    "shuffled_75": Shape(75, 20, 8, 8, 1.0, 4.0 * 75**0.5, shuffled=True),
}


def make_streams(folder: Path, sizes: dict[str, int]) -> None:
    """Write each stream into a folder of its name; sizes holds the numbers of datapoints."""
    for number, (name, shape) in enumerate(SHAPES.items()):
        N = sizes["stream" if name.startswith("stream") else "long"]
        sample_stream(np.random.default_rng(20 + number), shape, N).save(folder / name)


def sample_stream(rng: np.random.Generator, shape: Shape, N: int) -> Stream:
    """Sample N datapoints."""
    K, D = shape.clusters, shape.columns
    centres = sample_separated_centres(rng, K, D, shape.separation)
    dimensions = rng.integers(shape.min_dimension, shape.max_dimension + 1, size=K)
    bases = [np.linalg.qr(rng.normal(size=(D, max(d, 1))))[0][:, :d] for d in dimensions]
    labels, begins = sample_segments(rng, shape, N)
    along = shape.extent * sample_autocorrelated(rng, (N, shape.max_dimension), shape.correlation, begins)
    x = NOISE * rng.normal(size=(N, D))
    for k, (centre, basis) in enumerate(zip(centres, bases, strict=True)):
        members = labels == k
        x[members] += centre + along[members][:, : basis.shape[1]] @ basis.T
    return Stream(x, labels, K, shape.max_dimension, shape.extent, NOISE, shape.separation)


def sample_separated_centres(rng: np.random.Generator, K: int, D: int, separation: float) -> Floats:
    """Sample K points with a least distance in a cube, which grows until they fit."""
    half = 0.5 * separation / np.sqrt(D)
    while True:
        points = rng.uniform(-half, half, size=(K, D))
        squares = ((points[:, None] - points) ** 2).sum(axis=-1) + separation**2 * np.eye(K)
        if squares.min() >= separation**2:
            return points
        half *= 1.02


def sample_segments(rng: np.random.Generator, shape: Shape, N: int) -> tuple[Integers, Integers]:
    """Return the cluster of each step, and the steps at which segments start."""
    if shape.shuffled:
        return rng.integers(shape.clusters, size=N), np.arange(N)
    lengths = rng.integers(70, 91, size=N // 70 + 1)
    order = np.arange(len(lengths)) % shape.clusters
    begins = np.cumsum(lengths) - lengths
    return np.repeat(order, lengths)[:N], begins[begins < N]


def sample_autocorrelated(
    rng: np.random.Generator, size: tuple[int, int], correlation: float, begins: Integers
) -> Floats:
    """Sample coordinates of unit variance that are correlated within a segment only."""
    c = rng.normal(size=size)
    if correlation == 0.0:
        return c
    fresh = np.sqrt(1.0 - correlation**2)
    first = np.isin(np.arange(len(c)), begins)
    for t in range(1, len(c)):
        if not first[t]:
            c[t] = correlation * c[t - 1] + fresh * c[t]
    return c
