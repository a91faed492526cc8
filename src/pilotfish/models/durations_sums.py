"""Sums over all whole steps s = 1, 2, ... of laws given up to a factor."""

from collections.abc import Callable

import numpy as np

from pilotfish.types import Array, Float, Int

LogWeights = Callable[[Int[Array, " S"]], Float[Array, "S K"]]

NEGLIGIBLE = -30.0  # log of the share of a law that sums may leave out
RANGE = 600.0  # how far apart logarithms may be for their numbers to be added as they are
FURTHEST = 20  # no sum goes on beyond 2^20 steps


def support(log_weights: LogWeights) -> int:
    """A number of steps that holds all of the laws but a share of e^-30, or 2^20 where they reach further.

    Where a law falls as s^-p or faster from N on, what lies beyond N is below N f(N) / (p - 1). The laws
    here fall ever faster, so the slope over the last doubling will do for p.
    """
    ladder = 2 ** np.arange(FURTHEST + 1)
    log_w = log_weights(ladder)  # (21, K)
    slopes = np.diff(log_w, axis=0) / np.log(2.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        beyond = log_w[1:] + np.log(ladder[1:, None]) - np.log(-slopes - 1.0)
    small = (slopes <= -2.0) & (beyond <= log_w.max(axis=0) + NEGLIGIBLE)
    enough = np.flatnonzero(small.all(axis=1))
    return int(ladder[1 + enough[0]]) if len(enough) else int(ladder[-1])


def log_normalised(log_weights: LogWeights, longest: int) -> Float[Array, "S K"]:
    """Logarithms of the laws at s = 1 ... longest, each summing to one over all s >= 1."""
    steps = np.arange(1, max(longest, support(log_weights)) + 1)
    log_w = log_weights(steps)
    return np.asarray(log_w[:longest] - log_sum(log_w))


def moments_of(log_weights: LogWeights) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Mean and deviation of each law [steps]."""
    p = np.exp(log_normalised(log_weights, N := support(log_weights)))
    steps = np.arange(1.0, N + 1)
    means = steps @ p
    return means, np.sqrt((np.square(steps[:, None] - means) * p).sum(axis=0))


def quantile(log_weights: LogWeights, lost: float) -> int:
    """The least number of steps that a visit under any of the laws outlasts with probability at most lost."""
    return least_outlasted(np.exp(log_normalised(log_weights, support(log_weights))), lost)


def least_outlasted(p: Float[Array, "S K"], lost: float) -> int:
    longer = np.cumsum(p[::-1], axis=0)[::-1]  # p(s >= d), d = 1 ... S
    outlasting = np.flatnonzero((longer > lost).any(axis=1))
    return int(outlasting[-1]) + 1 if len(outlasting) else 1


def log_sum(log_w: Float[Array, "S K"]) -> Float[Array, " K"]:
    """log sum_s exp log_w[s], of columns that are not all -inf."""
    top = log_w.max(axis=0)
    return np.asarray(top + np.log(np.exp(log_w - top).sum(axis=0)))


def from_the_end(log_w: Float[Array, "N K"], rows: int, order: int = 1) -> Float[Array, "S K"]:
    """row d: log sum over s >= d of exp log_w[s], for the first rows; order 2 gives the same sum of these."""
    needed = log_w[:rows]
    return _cumulated(log_w[::-1], needed, order)[::-1][:rows]


def from_the_beginning(log_w: Float[Array, "N K"], order: int = 1) -> Float[Array, "N K"]:
    """row d: log sum over s <= d of exp log_w[s]; order 2 gives the same sum of these."""
    return _cumulated(log_w, log_w, order)


def _cumulated(log_w: Float[Array, "N K"], needed: Float[Array, "S K"], order: int) -> Float[Array, "N K"]:
    """Running sums, in logarithms where the needed rows are too far apart for numbers: that is slow."""
    top = np.where(np.isfinite(top := log_w.max(axis=0)), top, 0.0)
    if np.where(needed > -np.inf, top - needed, 0.0).max() > RANGE:
        for _ in range(order):
            log_w = np.logaddexp.accumulate(log_w, axis=0)
        return np.asarray(log_w)
    sums = np.exp(log_w - top)
    for _ in range(order):
        sums = np.cumsum(sums, axis=0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(sums) + top)
