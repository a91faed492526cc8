"""Normalisation, moments, quantiles and tails of distributions that are given by unnormalised log-weights."""

from collections.abc import Iterator

import numpy as np

from pilotfish.models.durations.quadrature import LogWeights, Quadrature, make_quadrature
from pilotfish.types import Array, Float

MAX_EXACT_QUANTILE = 2**20  # steps
MAX_LOG_RANGE = 600.0  # range of logarithms within which their exponentials are added directly
LOG_TINY = -1e300  # replaces -inf where it is subtracted
BLOCK_ROWS = 2**14  # nodes whose weights are computed at a time: they fit in the cache of a core


def log_probs(log_weights: LogWeights, max_duration: int) -> Float[Array, "S K"]:
    """Return log p(s) for s = 1 .. max_duration, normalised over all s >= 1."""
    log_w = log_weights(np.arange(1.0, max_duration + 1.0))
    return np.asarray(log_w - log_normaliser(log_weights, make_quadrature(log_weights, 1)))


def log_normaliser(log_weights: LogWeights, quadrature: Quadrature) -> Float[Array, " K"]:
    """Compute log sum_s exp log_weights(s) of each state, in memory that does not grow with the nodes."""

    def blocks() -> Iterator[Float[Array, "B K"]]:
        for n in range(0, len(quadrature.steps), BLOCK_ROWS):
            rows = slice(n, n + BLOCK_ROWS)
            yield log_weights(quadrature.steps[rows]) + quadrature.log_counts[rows, None]

    top = np.max([block.max(axis=0) for block in blocks()], axis=0)
    return np.asarray(top + np.log(sum(np.exp(block - top).sum(axis=0) for block in blocks())))


def mean_and_deviation(log_weights: LogWeights) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Return mean and standard deviation of each distribution [steps]."""
    quadrature = make_quadrature(log_weights, 1)
    p = _normalised_weights(log_weights, quadrature)
    means = quadrature.steps @ p
    return means, np.sqrt((np.square(quadrature.steps[:, None] - means) * p).sum(axis=0))


def _normalised_weights(log_weights: LogWeights, quadrature: Quadrature) -> Float[Array, "N K"]:
    """Return the probability that each node of the quadrature stands for."""
    log_w = log_weights(quadrature.steps) + quadrature.log_counts[:, None]
    weights = np.exp(log_w - log_w.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


def max_duration_from_weights(log_weights: LogWeights, tail_probability: float) -> int:
    """Return the smallest d with p(duration > d) <= tail_probability for all distributions.

    Above 2^20 steps it is rounded up to a power of two.
    """
    quadrature = make_quadrature(log_weights, 1)
    weights = _normalised_weights(log_weights, quadrature)
    survival = np.cumsum(weights[::-1], axis=0)[::-1]  # p(s >= d) at the beginning of a block
    begin = quadrature.single_steps
    while begin < quadrature.steps[-1] and (survival[quadrature.steps > begin][0] > tail_probability).any():
        begin *= 2
    if begin == quadrature.single_steps:
        return max(1, int(np.count_nonzero((survival[:begin] > tail_probability).any(axis=1))))
    if begin > MAX_EXACT_QUANTILE:
        return begin
    # Step by step within the block that contains it.
    above = survival[quadrature.steps > begin // 2][0] > tail_probability
    steps = np.arange(begin // 2 + 1.0, begin + 1.0)
    p = np.exp(log_weights(steps) - log_normaliser(log_weights, quadrature))[:, above]
    tail = survival[quadrature.steps > begin][0][above] if begin < quadrature.steps[-1] else 0.0
    survival = np.cumsum(p[::-1], axis=0)[::-1] + tail
    return begin // 2 + int(np.count_nonzero((survival > tail_probability).any(axis=1)))


def max_duration_from_probs(p: Float[Array, "S K"], tail_probability: float) -> int:
    """Return the same as `max_duration_from_weights` for normalised p(1 .. S)."""
    survival = np.cumsum(p[::-1], axis=0)[::-1]  # p(s >= d), d = 1 ... S
    outlasting = np.flatnonzero((survival > tail_probability).any(axis=1))
    return int(outlasting[-1]) + 1 if len(outlasting) else 1


def log_sum_exp(log_w: Float[Array, "S K"]) -> Float[Array, " K"]:
    """Compute log sum_s exp log_w[s] of each column; no column is -inf throughout."""
    top = log_w.max(axis=0)
    return np.asarray(top + np.log(np.exp(log_w - top).sum(axis=0)))


def log_survival_from_weights(
    log_weights: LogWeights, max_duration: int
) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
    """Compute log S(d) = log p(s >= d) and log (S(d) + S(d + 1) + ...) for d = 1 .. max_duration."""
    quadrature = make_quadrature(log_weights, max_duration)
    log_w = log_weights(quadrature.steps) + quadrature.log_counts[:, None]
    return log_reverse_cumsums(log_w - log_sum_exp(log_w), quadrature, max_duration)


def log_reverse_cumsum(
    log_p: Float[Array, "N K"], quadrature: Quadrature, rows: int, order: int = 1
) -> Float[Array, "S K"]:
    """Compute log sum of p(s) over s >= d for the first rows d; order 2 applies the sum twice.

    exp log_p is the probability that each node of the quadrature stands for.
    """
    if order == 2:
        return log_reverse_cumsums(log_p, quadrature, rows)[1]
    beyond, log_p = _log_sum_exp_row(log_p[rows:]), log_p[:rows]
    return _log_cumsum(np.concatenate([beyond, log_p[::-1]]), log_p)[:0:-1]


def log_reverse_cumsums(
    log_p: Float[Array, "N K"], quadrature: Quadrature, rows: int
) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
    """Compute `log_reverse_cumsum` of orders 1 and 2."""
    survival = log_reverse_cumsum(log_p, quadrature, rows)
    excess = _log_sum_exp_row(log_p[rows:] + np.log(quadrature.steps[rows:] - rows)[:, None])
    return survival, _log_cumsum(np.concatenate([excess, survival[::-1]]), survival)[:0:-1]


def log_cumsum(log_w: Float[Array, "S K"], quadrature: Quadrature, order: int = 1) -> Float[Array, "N K"]:
    """Compute log sum of exp log_w[d] over d <= s at every node s; order 2 applies the sum twice.

    Beyond its rows log_w is -inf.
    """
    padding = np.full((quadrature.single_steps - len(log_w), log_w.shape[1]), -np.inf)
    log_w = np.concatenate([log_w, padding])
    first_sum = _log_cumsum(log_w, log_w)
    excess = quadrature.steps[quadrature.single_steps :, None] - quadrature.single_steps
    if order == 1:
        constant = np.broadcast_to(first_sum[-1], (len(excess), log_w.shape[1]))
        return np.asarray(np.concatenate([first_sum, constant]))
    second_sum = _log_cumsum(first_sum, first_sum)
    return np.asarray(
        np.concatenate([second_sum, np.logaddexp(second_sum[-1], first_sum[-1] + np.log(excess))])
    )


def _log_sum_exp_row(log_w: Float[Array, "N K"]) -> Float[Array, "1 K"]:
    """Compute log sum exp of each column; -inf if it is empty."""
    top = np.max(log_w, axis=0, initial=-np.inf, keepdims=True)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(log_w - np.maximum(top, LOG_TINY)).sum(axis=0)) + top)


def _log_cumsum(log_w: Float[Array, "N K"], needed: Float[Array, "S K"]) -> Float[Array, "N K"]:
    """Compute running sums, in (slow) logarithms only if the needed rows span too wide a range."""
    top = np.where(np.isfinite(top := log_w.max(axis=0)), top, 0.0)
    if np.where(needed > -np.inf, top - needed, 0.0).max() > MAX_LOG_RANGE:
        return np.asarray(np.logaddexp.accumulate(log_w, axis=0))
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.cumsum(np.exp(log_w - top), axis=0)) + top)
