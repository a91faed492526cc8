"""Sufficient statistics of K Gaussians. Adding them is exact, so data may be cut anywhere."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import float_array

TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """All that K Gaussians remember of their data. Adding is exact and order-free.

    scatters[k] sums r (x - means[k]) (x - means[k])^T over the points, r their share of k.
    """

    mass: Float[Array, " K"]
    means: Float[Array, "K D"]
    scatters: Float[Array, "K D D"]

    def __add__(self, other: "Moments") -> "Moments":
        mass = self.mass + other.mass
        share = other.mass / np.maximum(mass, TINY)  # (K,), in [0, 1]
        shift = other.means - self.means
        between = np.einsum("k,ki,kj->kij", self.mass * share, shift, shift)
        means = self.means + share[:, None] * shift
        return Moments(mass, means, self.scatters + other.scatters + between)

    def __getitem__(self, kept: Bool[Array, " K"]) -> "Moments":
        return Moments(self.mass[kept], self.means[kept], self.scatters[kept])


def moments(x: Float[Array, "N D"], shares: Float[Array, "N K"]) -> Moments:
    """Sum points up, each shared among K components as its row of shares says."""
    x, shares = float_array(x, "x"), float_array(shares, "shares")
    if x.ndim != 2 or shares.ndim != 2 or len(x) != len(shares):
        raise InvalidInput(f"x has shape {x.shape} and shares {shares.shape}, expected (N, D) and (N, K)")
    mass = shares.sum(axis=0)
    means = shares.T @ x / np.maximum(mass, TINY)[:, None]
    scatters = []
    for k, mean in enumerate(means):
        error = x - mean  # (N, D)
        scatters.append((shares[:, k, None] * error).T @ error)
    return Moments(mass, means, np.stack(scatters))


def moments_about(
    origins: Float[Array, "K D"],
    mass: Float[Array, " K"],
    offsets: Float[Array, "K D"],
    scatters: Float[Array, "K D D"],
) -> Moments:
    """Moments from sums of r (x - origin) and r (x - origin)(x - origin)^T about any origins.

    A component of no mass keeps its origin as mean.
    """
    shift = offsets / np.maximum(mass, TINY)[:, None]
    between = (mass[:, None] * shift)[:, :, None] * shift[:, None, :]
    return Moments(mass, origins + shift, np.subtract(scatters, between, out=between))
