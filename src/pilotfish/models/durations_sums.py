"""Sums of laws of durations, given up to a factor: norms, moments, quantiles and tails."""

import numpy as np

from pilotfish.models.durations_rule import LogWeights, Rule, rule_for
from pilotfish.types import Array, Float

FAR = 2**20  # steps
RANGE = 600.0  # how far apart logarithms may be for their numbers to be added as they are


def log_normalised(log_weights: LogWeights, longest: int) -> Float[Array, "S K"]:
    """Logarithms of the laws at s = 1 ... longest, each summing to one over all s >= 1."""
    rule = rule_for(log_weights, 1)
    log_w = log_weights(np.arange(1.0, longest + 1.0))
    return np.asarray(log_w - log_sum(log_weights(rule.steps) + rule.log_counts[:, None]))


def moments_of(log_weights: LogWeights) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Mean and deviation of each law [steps]."""
    rule = rule_for(log_weights, 1)
    p = _shares(log_weights, rule)
    means = rule.steps @ p
    return means, np.sqrt((np.square(rule.steps[:, None] - means) * p).sum(axis=0))


def _shares(log_weights: LogWeights, rule: Rule) -> Float[Array, "N K"]:
    """The share of each law that every step of the rule stands for."""
    log_w = log_weights(rule.steps) + rule.log_counts[:, None]
    return np.asarray(np.exp(log_w - log_sum(log_w)))


def quantile(log_weights: LogWeights, lost: float) -> int:
    """The least number of steps that a visit under any of the laws outlasts with probability at most lost.

    Beyond FAR steps it is rounded up to a power of two.
    """
    rule = rule_for(log_weights, 1)
    longer = np.cumsum(_shares(log_weights, rule)[::-1], axis=0)[::-1]  # p(s >= d) where a block begins
    begin = rule.whole
    while begin < rule.steps[-1] and (longer[rule.steps > begin][0] > lost).any():
        begin *= 2
    if begin == rule.whole:
        return max(1, int(np.count_nonzero((longer[:begin] > lost).any(axis=1))))
    if begin > FAR:
        return begin
    # Within the block that holds it, step by step.
    slow = longer[rule.steps > begin // 2][0] > lost
    steps = np.arange(begin // 2 + 1.0, begin + 1.0)
    log_w = log_weights(rule.steps) + rule.log_counts[:, None]
    p = np.exp(log_weights(steps) - log_sum(log_w))[:, slow]
    beyond = longer[rule.steps > begin][0][slow] if begin < rule.steps[-1] else 0.0
    longer = np.cumsum(p[::-1], axis=0)[::-1] + beyond
    return begin // 2 + int(np.count_nonzero((longer > lost).any(axis=1)))


def least_outlasted(p: Float[Array, "S K"], lost: float) -> int:
    longer = np.cumsum(p[::-1], axis=0)[::-1]  # p(s >= d), d = 1 ... S
    outlasting = np.flatnonzero((longer > lost).any(axis=1))
    return int(outlasting[-1]) + 1 if len(outlasting) else 1


def log_sum(log_w: Float[Array, "S K"]) -> Float[Array, " K"]:
    """log sum_s exp log_w[s], of columns that are not all -inf."""
    top = log_w.max(axis=0)
    return np.asarray(top + np.log(np.exp(log_w - top).sum(axis=0)))


def log_tails_of(log_weights: LogWeights, longest: int) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
    """log p(a visit lasts d steps or more), and log of that summed over d and all above, d up to longest."""
    rule = rule_for(log_weights, longest)
    log_w = log_weights(rule.steps) + rule.log_counts[:, None]
    log_p = log_w - log_sum(log_w)
    return from_the_end(log_p, rule, longest), from_the_end(log_p, rule, longest, order=2)


def from_the_end(log_p: Float[Array, "N K"], rule: Rule, rows: int, order: int = 1) -> Float[Array, "S K"]:
    """row d: log sum over s >= d of p(s), for the first rows; order 2 gives the same sum of these.

    exp log_p is what each step of the rule adds to a sum over all of them.
    """
    log_p, beyond = log_p[: rule.whole], log_p[rule.whole :]
    longer = _cumulated(np.concatenate([_log_total(beyond), log_p[::-1]]), log_p[:rows])[:0:-1]
    if order == 1:
        return longer[:rows]
    excess = _log_total(beyond + np.log(rule.steps[rule.whole :] - rule.whole)[:, None])
    return _cumulated(np.concatenate([excess, longer[::-1]]), longer[:rows])[:0:-1][:rows]


def from_the_beginning(log_w: Float[Array, "S K"], rule: Rule, order: int = 1) -> Float[Array, "N K"]:
    """At every step s of the rule: log sum over d <= s of exp log_w[d]; order 2 gives the same sum of these.

    Beyond its rows log_w is -inf.
    """
    none = np.full((rule.whole - len(log_w), log_w.shape[1]), -np.inf)
    log_w = np.concatenate([log_w, none])
    once = _cumulated(log_w, log_w)
    further = rule.steps[rule.whole :, None] - rule.whole
    if order == 1:
        lasting = np.broadcast_to(once[-1], (len(further), log_w.shape[1]))
        return np.asarray(np.concatenate([once, lasting]))
    twice = _cumulated(once, once)
    return np.asarray(np.concatenate([twice, np.logaddexp(twice[-1], once[-1] + np.log(further))]))


def _log_total(log_w: Float[Array, "N K"]) -> Float[Array, "1 K"]:
    """log sum exp of each column, -inf where it is empty or holds nothing else."""
    return np.asarray(np.logaddexp.reduce(log_w, axis=0)[None])


def _cumulated(log_w: Float[Array, "N K"], needed: Float[Array, "S K"]) -> Float[Array, "N K"]:
    """Running sums, in logarithms where the needed rows are too far apart for numbers: that is slow."""
    top = np.where(np.isfinite(top := log_w.max(axis=0)), top, 0.0)
    if np.where(needed > -np.inf, top - needed, 0.0).max() > RANGE:
        return np.asarray(np.logaddexp.accumulate(log_w, axis=0))
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.cumsum(np.exp(log_w - top), axis=0)) + top)
