"""Sufficient statistics of K Gaussians; they can be added, so that data may be processed in parts."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import float_array, shorten_repr

TINY = float(np.finfo(float).tiny)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Counts, means and scatter matrices of K components; a sum of two is that of all data, in any order.

    Attributes:
        counts: Sum of the responsibilities, N_k.
        means: Weighted mean.
        scatter_matrices: Sum of r (x - mean) (x - mean)^T, with responsibilities r.
    """

    counts: Float[Array, " K"]
    means: Float[Array, "K D"]
    scatter_matrices: Float[Array, "K D D"]

    @classmethod
    def from_data(cls, x: Float[Array, "N D"], responsibilities: Float[Array, "N K"]) -> "Moments":
        """Return the moments of data under given responsibilities.

        Args:
            x: Datapoints.
            responsibilities: Responsibility of each component for each datapoint, at least 0.

        Raises:
            InvalidInput: If arrays are not finite or shapes do not match.
        """
        x, responsibilities = float_array(x, "x"), float_array(responsibilities, "responsibilities")
        if x.ndim != 2 or responsibilities.ndim != 2 or len(x) != len(responsibilities):
            raise InvalidInput(
                f"x has shape {x.shape} and responsibilities {responsibilities.shape}, expected (N, D) and "
                "(N, K)"
            )
        counts = responsibilities.sum(axis=0)
        means = responsibilities.T @ x / np.maximum(counts, TINY)[:, None]
        scatter_matrices = []
        for k, mean in enumerate(means):
            error = x - mean  # (N, D)
            scatter_matrices.append((responsibilities[:, k, None] * error).T @ error)
        return cls(counts, means, np.stack(scatter_matrices))

    @classmethod
    def from_sums(
        cls,
        origins: Float[Array, "K D"],
        counts: Float[Array, " K"],
        deviation_sums: Float[Array, "K D"],
        scatter_matrices: Float[Array, "K D D"],
    ) -> "Moments":
        """Return moments from sums about arbitrary origins.

        A component with zero count keeps its origin as mean.

        Args:
            origins: Origin of each component.
            counts: Sum of the responsibilities r.
            deviation_sums: Sum of r (x - origin).
            scatter_matrices: Sum of r (x - origin) (x - origin)^T.
        """
        shift = deviation_sums / np.maximum(counts, TINY)[:, None]
        between = (counts[:, None] * shift)[:, :, None] * shift[:, None, :]
        return cls(counts, origins + shift, np.subtract(scatter_matrices, between, out=between))

    def __add__(self, other: "Moments") -> "Moments":
        counts = self.counts + other.counts
        responsibility_fraction = other.counts / np.maximum(counts, TINY)  # (K,), in [0, 1]
        shift = other.means - self.means
        between = np.einsum("k,ki,kj->kij", self.counts * responsibility_fraction, shift, shift)
        means = self.means + responsibility_fraction[:, None] * shift
        return Moments(counts, means, self.scatter_matrices + other.scatter_matrices + between)

    def __getitem__(self, mask: Bool[Array, " K"]) -> "Moments":
        return Moments(self.counts[mask], self.means[mask], self.scatter_matrices[mask])
