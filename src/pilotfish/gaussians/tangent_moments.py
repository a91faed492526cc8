"""Sufficient statistics of K Gaussians on R^n x S^3 x ...: sums over tangent vectors at given origins."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.moments import TINY
from pilotfish.geometry import exp_map, karcher_mean, log_map, parallel_transport
from pilotfish.types import Array, Bool, Float


@dataclass(frozen=True, slots=True, eq=False)
class TangentMoments:
    """What K Gaussians remember of data, seen as tangent vectors v at K origins. Adding is exact.

    offsets[k] sums r v and squares[k] r v v^T over the points, r their share of k.
    means and scatters are exact where the offsets vanish: the origin is then the Karcher mean. Elsewhere
    means are one step of the iteration to it, and scatters are right to first order in that step: the sums
    about the stepped mean, carried there by parallel transport. Off the orientations both are always exact.
    """

    counts: Float[Array, " K"]
    origins: Float[Array, "K D"]
    offsets: Float[Array, "K E"]
    outer_products: Float[Array, "K E E"]
    orientation_starts: tuple[int, ...]

    @property
    def means(self) -> Float[Array, "K D"]:
        return np.asarray(exp_map(self.origins, self._mean_steps, self.orientation_starts))

    @property
    def scatter_matrices(self) -> Float[Array, "K E E"]:
        """Sums of r u u^T, u the tangent vectors at means."""
        steps = self._mean_steps
        about = self.outer_products - np.einsum("k,ki,kj->kij", self.counts, steps, steps)
        rotation = parallel_transport(steps, self.orientation_starts)
        return np.asarray(rotation @ about @ rotation.transpose(0, 2, 1))

    @property
    def _mean_steps(self) -> Float[Array, "K E"]:
        return np.asarray(self.offsets / np.maximum(self.counts, TINY)[:, None])

    def __add__(self, other: "TangentMoments") -> "TangentMoments":
        if self.orientation_starts != other.orientation_starts or not np.array_equal(
            self.origins, other.origins
        ):
            raise InvalidInput(
                "two sums of tangent vectors have different origins, expected the same; take both from the "
                "same model"
            )
        return TangentMoments(
            self.counts + other.counts,
            self.origins,
            self.offsets + other.offsets,
            self.outer_products + other.outer_products,
            self.orientation_starts,
        )

    def __getitem__(self, mask: Bool[Array, " K"]) -> "TangentMoments":
        return TangentMoments(
            self.counts[mask],
            self.origins[mask],
            self.offsets[mask],
            self.outer_products[mask],
            self.orientation_starts,
        )


def tangent_moments(
    x: Float[Array, "N D"], responsibilities: Float[Array, "N K"], orientation_starts: tuple[int, ...]
) -> TangentMoments:
    """Sums of points, each shared among K components as its row of shares says, about the Karcher means."""
    origins = np.stack([karcher_mean(x, weights, orientation_starts) for weights in responsibilities.T])
    offsets, outer_products = [], []
    for origin, weights in zip(origins, responsibilities.T, strict=True):
        v = log_map(origin, x[weights > 0.0], orientation_starts)  # (n, E)
        weighted = weights[weights > 0.0, None] * v
        offsets.append(weighted.sum(axis=0))
        outer_products.append(weighted.T @ v)
    return TangentMoments(
        responsibilities.sum(axis=0), origins, np.stack(offsets), np.stack(outer_products), orientation_starts
    )
