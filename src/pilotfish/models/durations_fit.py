"""Maximum likelihood of exponential families on whole steps, from visits of which recordings cut some off."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pilotfish.models.durations_rule import Rule, rule_for, step_by_step
from pilotfish.models.durations_sums import from_the_beginning, from_the_end, log_sum
from pilotfish.models.visits import Visits
from pilotfish.types import Array, Bool, Float

SWEEPS, MORE_SWEEPS, HALVINGS = 50, 3, 30
NEAR = 1e-6  # a parameter as close to its bound, as a share of it, is held there
ENOUGH = 1e-14  # gains below this share of the log-likelihood are rounding


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """Laws p(s) proportional to exp(statistics(s) . theta + base(s)), s >= 1; statistics are not negative.

    theta[:, k] is kept between lower[:, k] and upper[:, k].
    """

    statistics: Callable[[Float[Array, " S"]], Float[Array, "S Q"]]
    base: Callable[[Float[Array, " S"]], Float[Array, "S #K"]]
    lower: Float[Array, "Q K"]
    upper: Float[Array, "Q K"]


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Of each state's visits: the log-likelihood, its gradient, and what they tell of theta.

    information is minus the Hessian, complete what it would be had nothing been cut off.
    """

    value: Float[Array, " K"]
    gradient: Float[Array, "Q K"]
    information: Float[Array, "K Q Q"]
    complete: Float[Array, "K Q Q"]


def most_likely(
    family: Family, visits: Visits, start: Float[Array, "Q K"], going_on: bool
) -> Float[Array, "Q K"]:
    """theta of the largest likelihood, by Newton steps within the bounds; never less likely than start.

    Going on from the law before, a few steps will do: expectation-maximisation comes back.
    With whole visits alone the likelihood is concave and the result its one maximum; else it is a maximum.
    Source: Bertsekas 1982, projected Newton methods; Louis 1982 for the information of what was cut off.
    """
    theta, here = start, evaluated(family, visits, start)
    for _ in range(MORE_SWEEPS if going_on else SWEEPS):
        step = _direction(family, theta, here)
        gains = 0.5 * (step * here.gradient).sum(axis=0)  # what a quadratic likelihood would gain
        if (settled := gains <= ENOUGH * (1.0 + np.abs(here.value))).all():
            break
        theta, here = _ascended(family, visits, theta, here, np.where(settled, 0.0, step), gains)
    return theta


def evaluated(family: Family, visits: Visits, theta: Float[Array, "Q K"]) -> Point:
    """The log-likelihood of whole visits log p(s), of those cut off log p(s >= d), and so on, at theta."""
    rule = rule_for(lambda s: family.statistics(s) @ theta + family.base(s), len(visits.whole))
    X = family.statistics(rule.steps)  # (N, Q)
    log_w = X @ theta + family.base(rule.steps) + rule.log_counts[:, None]
    log_p = log_w - log_sum(log_w)
    log_longer = log_p + np.log(rule.steps)[:, None]
    log_mean = log_sum(log_longer)
    begun = (visits.had_begun + visits.fills).sum(axis=0)  # those met at a random one of their steps
    fresh = (visits.whole + visits.goes_on).sum(axis=0)
    expected, spread = _moments(X, np.exp(log_p))
    expected_met, spread_met = _moments(X, np.exp(log_longer - log_mean))
    value = (visits.whole * log_p[: len(visits.whole)]).sum(axis=0) - begun * log_mean
    gradient = X[: len(visits.whole)].T @ visits.whole - fresh * expected - begun * expected_met
    complete = fresh[:, None, None] * spread + begun[:, None, None] * spread_met
    missing = np.zeros_like(complete)
    for counts, order in ((visits.goes_on + visits.had_begun, 1), (visits.fills, 2)):
        if counts.any():
            part = _cut_off(X, log_p, counts, rule, order)
            value, gradient, missing = value + part[0], gradient + part[1], missing + part[2]
    return Point(value, gradient, complete - missing, complete)


def _moments(
    X: Float[Array, "N Q"], p: Float[Array, "N K"]
) -> tuple[Float[Array, "Q K"], Float[Array, "K Q Q"]]:
    """Mean and covariance of the statistics under each law."""
    means = X.T @ p
    return means, _second(X, p) - means.T[:, :, None] * means.T[:, None, :]


def _second(X: Float[Array, "N Q"], weights: Float[Array, "N K"]) -> Float[Array, "K Q Q"]:
    """Weighted sums of the statistics' products."""
    Q = X.shape[1]
    products = (X[:, :, None] * X[:, None, :]).reshape(len(X), Q * Q)
    return np.asarray(weights.T @ products).reshape(-1, Q, Q)


def _cut_off(
    X: Float[Array, "N Q"], log_p: Float[Array, "N K"], counts: Float[Array, "S K"], rule: Rule, order: int
) -> tuple[Float[Array, " K"], Float[Array, "Q K"], Float[Array, "K Q Q"]]:
    """What visits add of which only d steps were seen: value, gradient, and the information that is missing.

    order 1 where p(s >= d) is what was seen, order 2 where it is the sum of that over d and all above.
    """
    S = len(counts)
    log_tail = from_the_end(log_p, rule, S, order)
    completed = _completed(log_p, counts, log_tail, rule, order)
    with np.errstate(divide="ignore"):
        log_X = np.log(X)
    M = np.stack(  # expected statistics given d, (Q, S, K)
        [np.exp(from_the_end(log_p + log_x[:, None], rule, S, order) - log_tail) for log_x in log_X.T]
    )
    missing = _second(X, completed) - np.einsum("ask,bsk,sk->kab", M, M, counts)
    return (counts * log_tail).sum(axis=0), X.T @ completed, missing


def completed_visits(
    log_p: Float[Array, "N K"], visits: Visits, rule: Rule | None = None
) -> Float[Array, "N K"]:
    """All visits, those cut off spread over the lengths that they may have had.

    exp log_p is what each step of the rule holds; without a rule they are s = 1 ... N, and nothing is longer.
    """
    rule = rule or step_by_step(len(log_p))
    total = np.zeros_like(log_p)
    total[: len(visits.whole)] = visits.whole
    for counts, order in ((visits.goes_on + visits.had_begun, 1), (visits.fills, 2)):
        if counts.any():
            log_tail = from_the_end(log_p, rule, len(counts), order)
            total += _completed(log_p, counts, log_tail, rule, order)
    return total


def _completed(
    log_p: Float[Array, "N K"],
    counts: Float[Array, "S K"],
    log_tail: Float[Array, "S K"],
    rule: Rule,
    order: int,
) -> Float[Array, "N K"]:
    """Visits of which only d steps were seen, by how long they may have lasted."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log_share = np.where(counts > 0.0, np.log(counts) - log_tail, -np.inf)
    return np.asarray(np.exp(from_the_beginning(log_share, rule, order) + log_p))


def _ascended(
    family: Family,
    visits: Visits,
    theta: Float[Array, "Q K"],
    here: Point,
    step: Float[Array, "Q K"],
    gains: Float[Array, " K"],
) -> tuple[Float[Array, "Q K"], Point]:
    """A step for every state, halved for those that would lose by it, and none where that is of no use."""
    # Parameters that must stay below zero, where tails become endless, come no closer than half way at once.
    within = np.where(family.upper < 0.0, np.minimum(family.upper, 0.5 * theta), family.upper)
    share = _up_to_the_first_bound(theta, step, family.lower, within)
    for _ in range(HALVINGS):
        there = np.clip(theta + share * step, family.lower, within)
        there = np.where(step == 0.0, theta, there)
        found = evaluated(family, visits, there)
        lost = ~(found.value >= here.value)
        if not lost.any():
            return there, found
        share = np.where(lost, 0.5 * share, share)
        if not (lost & (share * gains > ENOUGH * (1.0 + np.abs(here.value)))).any():
            break
    there = np.where(lost, theta, there)
    return there, evaluated(family, visits, there)


def _up_to_the_first_bound(
    theta: Float[Array, "Q K"], step: Float[Array, "Q K"], low: Float[Array, "Q K"], high: Float[Array, "Q K"]
) -> Float[Array, " K"]:
    """The share of each state's step that ends at a bound ahead, or all; bounds already reached only clip.

    A step bent by a bound need not lead upwards.
    """
    bound = np.where(step < 0.0, low, high)
    ahead = (step != 0.0) & (np.abs(bound - theta) > NEAR * np.abs(theta))
    room = np.divide(bound - theta, step, out=np.ones_like(step), where=ahead)
    return np.asarray(np.minimum(1.0, room.min(axis=0)))


def _direction(family: Family, theta: Float[Array, "Q K"], here: Point) -> Float[Array, "Q K"]:
    """Newton's, of the parameters that no bound holds; where the Hessian is no help, that of whole visits."""
    low = np.isfinite(family.lower) & (theta - family.lower <= NEAR * np.abs(family.lower))
    high = np.isfinite(family.upper) & (family.upper - theta <= NEAR * np.abs(family.upper))
    held = (low & (here.gradient < 0)) | (high & (here.gradient > 0))
    gradient = np.where(held, 0.0, here.gradient).T  # (K, Q)
    # A law on one length alone has no variance but rounding: then the gradient says how far to go.
    least = np.maximum(1e-6 * np.abs(gradient), 1e-100)
    scale = np.sqrt(np.maximum(np.diagonal(here.complete, axis1=1, axis2=2), least))  # (K, Q)
    by = scale[:, :, None] * scale[:, None, :]
    observed, whole = (_free(matrix / by, held.T) for matrix in (here.information, here.complete))
    sound = np.linalg.eigvalsh(observed)[:, 0] > 1e-6
    chosen = np.where(sound[:, None, None], observed, whole) + 1e-12 * np.eye(len(theta))
    return np.asarray((np.linalg.solve(chosen, (gradient / scale)[:, :, None])[:, :, 0] / scale).T)


def _free(matrix: Float[Array, "K Q Q"], held: Bool[Array, "K Q"]) -> Float[Array, "K Q Q"]:
    """The same of parameters that are free, the identity of those that are held."""
    free = ~(held[:, :, None] | held[:, None, :])
    return np.asarray(np.where(free, matrix, np.eye(matrix.shape[1])))
