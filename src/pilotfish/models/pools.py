"""Opinions about one thing, pooled: the normalised product of Gaussians, each raised to a power."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Bool, Float

LEAST = 1e-9  # power of a frame that is heard; at zero alone the pool would be flat


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """What P frames say of a visit that was held out, in deviations as each frame sees them.

    offsets[p] leads from the visit's mean to the frame's, W = whiteners[p] has W^T W = covariance^-1, and
    scatters[p] is the covariance of the visit's own points.
    """

    offsets: Float[Array, "P E"]
    whiteners: Float[Array, "P E E"]
    scatters: Float[Array, "P E E"]


@dataclass(frozen=True, slots=True, eq=False)
class Opinions:
    """The same in the world, for M held-out visits, each about its own mean.

    precisions[m, p] is what frame p knows, shifts[m, p] is it times the frame's mean, and surprises[m, p] the
    mean of u^T precision u over the visit's points u.
    """

    precisions: Float[Array, "M P E E"]
    shifts: Float[Array, "M P E"]
    surprises: Float[Array, "M P"]

    @property
    def frames(self) -> int:
        return int(self.surprises.shape[1])


def opinions(from_world: Sequence[Float[Array, "P E E"]], held: Sequence[Held]) -> Opinions:
    """Each frame's opinion carried to the world: u there is from_world[m][p] u in frame p."""
    precisions, shifts, surprises = [], [], []
    for B, told in zip(from_world, held, strict=True):
        white = told.whiteners @ B  # (P, E, E), from the world to unit covariance
        precisions.append(white.transpose(0, 2, 1) @ white)
        means = np.einsum("pij,pj->pi", told.whiteners, told.offsets)
        shifts.append(np.einsum("pij,pi->pj", white, means))
        spread = told.whiteners @ told.scatters @ told.whiteners.transpose(0, 2, 1)
        surprises.append(np.trace(spread, axis1=1, axis2=2))
    return Opinions(np.stack(precisions), np.stack(shifts), np.stack(surprises))


def log_scores(told: Opinions, powers: Float[Array, " P"]) -> Float[Array, " M"]:
    """Mean log-probability of each held-out visit's points under the pool, up to one constant for all powers.

    With L = sum of v_p L_p and h = sum of v_p h_p it is (log |L| - v . s - h^T L^-1 h) / 2.
    """
    L = np.einsum("p,mpij->mij", powers, told.precisions)
    h = np.einsum("p,mpi->mi", powers, told.shifts)
    means = np.linalg.solve(L, h[..., None])[..., 0]
    log_determinants = np.linalg.slogdet(L)[1]
    return np.asarray(0.5 * (log_determinants - told.surprises @ powers - np.sum(h * means, axis=1)))


def slopes(told: Opinions, powers: Float[Array, " P"]) -> Float[Array, " P"]:
    """The derivative of the mean of log_scores with respect to each power."""
    L = np.einsum("p,mpij->mij", powers, told.precisions)
    h = np.einsum("p,mpi->mi", powers, told.shifts)
    means = np.linalg.solve(L, h[..., None])[..., 0]
    expected = np.einsum("mij,mpji->mp", np.linalg.inv(L), told.precisions)  # tr(L^-1 L_p)
    quadratic = np.einsum("mi,mpij,mj->mp", means, told.precisions, means)
    linear = np.einsum("mpi,mi->mp", told.shifts, means)
    return np.asarray((0.5 * (expected - told.surprises + quadratic) - linear).mean(axis=0))


def best_powers(told: Opinions, heard: Bool[Array, " P"]) -> Float[Array, " P"]:
    """The powers of the frames heard, zero for the others, that make the held-out visits most probable.

    The mean of log_scores is concave in the powers, so there is one best value; where several powers give it
    (frames that say the same) the one nearest to equal shares, from which the search begins.
    Source: Heskes 1998, Selecting weighting factors in logarithmic opinion pools.
    """
    from scipy.optimize import minimize  # here, because scipy doubles the time of importing pilotfish

    only = Opinions(told.precisions[:, heard], told.shifts[:, heard], told.surprises[:, heard])
    begin = np.full(only.frames, 1.0 / only.frames)

    def loss(powers: Float[Array, " P"]) -> tuple[float, Float[Array, " P"]]:
        return -float(log_scores(only, powers).mean()), -slopes(only, powers)

    found = minimize(loss, begin, jac=True, method="L-BFGS-B", bounds=[(LEAST, None)] * only.frames)
    powers = np.zeros(told.frames)
    powers[heard] = found.x
    return powers
