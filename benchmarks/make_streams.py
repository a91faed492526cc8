"""Sequence data: a stream that visits clusters, each a random subspace, in a circle or in any order."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from problems import Floats, Integers, Stream

NOISE = 0.2


@dataclass(frozen=True, slots=True)
class Shape:
    """What a stream is drawn from.

    Subspaces have least to most dimensions. A visit lasts 70 to 90 steps, and then the next cluster of the
    circle has its turn; shuffled: every step draws its cluster anew. Along a subspace a visit wanders: from
    step to step coordinates are correlated by so much.
    """

    columns: int
    clusters: int
    least: int
    most: int
    extent: float
    apart: float
    correlation: float = 0.0
    shuffled: bool = False


# Near: a cluster extends farther than to the next centre, so that the nearest mean is often another's,
# and about as often in 75 dimensions as in 14.
# Far: as section 5.7 of the thesis draws them, at least 4 sqrt(D) apart.
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
    """Each shape in a folder of its name; sizes says how many datapoints near ones and far ones have."""
    for number, (name, shape) in enumerate(SHAPES.items()):
        N = sizes["stream" if name.startswith("stream") else "long"]
        sample_stream(np.random.default_rng(20 + number), shape, N).save(folder / name)


def sample_stream(rng: np.random.Generator, shape: Shape, N: int) -> Stream:
    K, D = shape.clusters, shape.columns
    centres = sample_separated_centres(rng, K, D, shape.apart)
    dimensions = rng.integers(shape.least, shape.most + 1, size=K)
    bases = [np.linalg.qr(rng.normal(size=(D, max(d, 1))))[0][:, :d] for d in dimensions]
    labels, begins = sample_segments(rng, shape, N)
    along = shape.extent * sample_autocorrelated(rng, (N, shape.most), shape.correlation, begins)
    x = NOISE * rng.normal(size=(N, D))
    for k, (centre, basis) in enumerate(zip(centres, bases, strict=True)):
        here = labels == k
        x[here] += centre + along[here][:, : basis.shape[1]] @ basis.T
    return Stream(x, labels, K, shape.most, shape.extent, NOISE, shape.apart)


def sample_separated_centres(rng: np.random.Generator, K: int, D: int, apart: float) -> Floats:
    """K points of a cube, each at least so far from the others; the cube grows until they are."""
    half = 0.5 * apart / np.sqrt(D)
    while True:
        points = rng.uniform(-half, half, size=(K, D))
        squares = ((points[:, None] - points) ** 2).sum(axis=-1) + apart**2 * np.eye(K)
        if squares.min() >= apart**2:
            return points
        half *= 1.02


def sample_segments(rng: np.random.Generator, shape: Shape, N: int) -> tuple[Integers, Integers]:
    """The cluster of each step, and the steps at which visits begin."""
    if shape.shuffled:
        return rng.integers(shape.clusters, size=N), np.arange(N)
    lengths = rng.integers(70, 91, size=N // 70 + 1)
    order = np.arange(len(lengths)) % shape.clusters
    begins = np.cumsum(lengths) - lengths
    return np.repeat(order, lengths)[:N], begins[begins < N]


def sample_autocorrelated(
    rng: np.random.Generator, size: tuple[int, int], correlation: float, begins: Integers
) -> Floats:
    """Coordinates of unit variance, correlated from step to step within a visit, not between visits."""
    c = rng.normal(size=size)
    if correlation == 0.0:
        return c
    fresh = np.sqrt(1.0 - correlation**2)
    first = np.isin(np.arange(len(c)), begins)
    for t in range(1, len(c)):
        if not first[t]:
            c[t] = correlation * c[t - 1] + fresh * c[t]
    return c
