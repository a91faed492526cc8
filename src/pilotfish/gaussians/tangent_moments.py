"""Sufficient statistics of K Gaussians on R^n x S^3 x ...: sums over tangent vectors at given origins."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.moments import TINY
from pilotfish.geometry import exp_at, karcher_mean, log_at, transport
from pilotfish.types import Array, Bool, Float


@dataclass(frozen=True, slots=True, eq=False)
class TangentMoments:
    """What K Gaussians remember of data, seen as tangent vectors v at K origins. Adding is exact.

    offsets[k] sums r v and squares[k] r v v^T over the points, r their share of k.
    means and scatters are exact where the offsets vanish: the origin is then the Karcher mean. Elsewhere
    means are one step of the iteration to it, and scatters are right to first order in that step: the sums
    about the stepped mean, carried there by parallel transport. Off the orientations both are always exact.
    """

    mass: Float[Array, " K"]
    origins: Float[Array, "K D"]
    offsets: Float[Array, "K E"]
    squares: Float[Array, "K E E"]
    turns: tuple[int, ...]

    @property
    def means(self) -> Float[Array, "K D"]:
        return np.asarray(exp_at(self.origins, self._steps, self.turns))

    @property
    def scatters(self) -> Float[Array, "K E E"]:
        """Sums of r u u^T, u the tangent vectors at means."""
        steps = self._steps
        about = self.squares - np.einsum("k,ki,kj->kij", self.mass, steps, steps)
        carry = transport(steps, self.turns)
        return np.asarray(carry @ about @ carry.transpose(0, 2, 1))

    @property
    def _steps(self) -> Float[Array, "K E"]:
        return np.asarray(self.offsets / np.maximum(self.mass, TINY)[:, None])

    def __add__(self, other: "TangentMoments") -> "TangentMoments":
        if self.turns != other.turns or not np.array_equal(self.origins, other.origins):
            raise InvalidInput(
                "two sums of tangent vectors have different origins, expected the same; take both from the "
                "same model"
            )
        return TangentMoments(
            self.mass + other.mass,
            self.origins,
            self.offsets + other.offsets,
            self.squares + other.squares,
            self.turns,
        )

    def __getitem__(self, kept: Bool[Array, " K"]) -> "TangentMoments":
        return TangentMoments(
            self.mass[kept], self.origins[kept], self.offsets[kept], self.squares[kept], self.turns
        )


def tangent_moments(
    x: Float[Array, "N D"], shares: Float[Array, "N K"], turns: tuple[int, ...]
) -> TangentMoments:
    """Sums of points, each shared among K components as its row of shares says, about the Karcher means."""
    origins = np.stack([karcher_mean(x, share, turns) for share in shares.T])
    offsets, squares = [], []
    for origin, share in zip(origins, shares.T, strict=True):
        v = log_at(origin, x[share > 0.0], turns)  # (n, E)
        weighted = share[share > 0.0, None] * v
        offsets.append(weighted.sum(axis=0))
        squares.append(weighted.T @ v)
    return TangentMoments(shares.sum(axis=0), origins, np.stack(offsets), np.stack(squares), turns)
