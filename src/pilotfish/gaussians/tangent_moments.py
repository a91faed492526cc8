"""Sufficient statistics of K Gaussians on R^n x S^3 x ..., as sums over tangent vectors at fixed origins."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.moments import TINY
from pilotfish.geometry import exp_map, karcher_mean, log_map, parallel_transport
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class TangentMoments:
    """Sums over tangent vectors v at K origins; a sum of two with equal origins is that of all data.

    Means and scatter matrices are exact if the sums of deviations are zero: the origin is the Karcher mean.
    Otherwise means are one step of its iteration, and scatter matrices are exact to first order in that step,
    moved by parallel transport. Off the orientations both are exact.

    Attributes:
        counts: Sum of the responsibilities r, N_k.
        origins: Origins on the manifold.
        deviation_sums: Sum of r v.
        outer_products: Sum of r v v^T.
        orientation_starts: First column of each quaternion in origins.
    """

    counts: Float[Array, " K"]
    origins: Float[Array, "K D"]
    deviation_sums: Float[Array, "K E"]
    outer_products: Float[Array, "K E E"]
    orientation_starts: tuple[int, ...]

    @classmethod
    def from_data(
        cls,
        x: Float[Array, "N D"],
        responsibilities: Float[Array, "N K"],
        orientation_starts: tuple[int, ...],
    ) -> "TangentMoments":
        """Return the statistics of data about the Karcher mean of each component.

        Args:
            x: Datapoints on the manifold.
            responsibilities: Responsibility of each component for each datapoint, at least 0.
            orientation_starts: First column of each quaternion.
        """
        origins = np.stack([karcher_mean(x, weights, orientation_starts) for weights in responsibilities.T])
        deviation_sums, outer_products = [], []
        for origin, weights in zip(origins, responsibilities.T, strict=True):
            v = log_map(origin, x[weights > 0.0], orientation_starts)  # (n, E)
            weighted = weights[weights > 0.0, None] * v
            deviation_sums.append(weighted.sum(axis=0))
            outer_products.append(weighted.T @ v)
        return cls(
            responsibilities.sum(axis=0),
            origins,
            np.stack(deviation_sums),
            np.stack(outer_products),
            orientation_starts,
        )

    @property
    def means(self) -> Float[Array, "K D"]:
        """Return the Karcher means, to first order in the sums of deviations."""
        return np.asarray(exp_map(self.origins, self._mean_steps, self.orientation_starts))

    @property
    def scatter_matrices(self) -> Float[Array, "K E E"]:
        """Return the sums of r u u^T, with tangent vectors u at the means."""
        steps = self._mean_steps
        centred = self.outer_products - np.einsum("k,ki,kj->kij", self.counts, steps, steps)
        rotation = parallel_transport(steps, self.orientation_starts)
        return np.asarray(rotation @ centred @ rotation.transpose(0, 2, 1))

    @property
    def _mean_steps(self) -> Float[Array, "K E"]:
        return np.asarray(self.deviation_sums / np.maximum(self.counts, TINY)[:, None])

    def __add__(self, other: "TangentMoments") -> "TangentMoments":
        if self.orientation_starts != other.orientation_starts or not np.array_equal(
            self.origins, other.origins
        ):
            raise InvalidInput(
                "two sums of tangent vectors have different origins, expected the same; compute both with "
                "the same model"
            )
        return TangentMoments(
            self.counts + other.counts,
            self.origins,
            self.deviation_sums + other.deviation_sums,
            self.outer_products + other.outer_products,
            self.orientation_starts,
        )

    def __getitem__(self, mask: Bool[Array, " K"]) -> "TangentMoments":
        return TangentMoments(
            self.counts[mask],
            self.origins[mask],
            self.deviation_sums[mask],
            self.outer_products[mask],
            self.orientation_starts,
        )
