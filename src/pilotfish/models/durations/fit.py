"""Maximum likelihood of exponential families on whole steps, from visits of which recordings cut some off."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pilotfish.models.durations.quadrature import Quadrature, make_quadrature, single_step_quadrature
from pilotfish.models.durations.sums import log_cumsum, log_reverse_cumsum, log_sum_exp
from pilotfish.models.segments import Segments
from pilotfish.types import Array, Bool, Float

MAX_ITERATIONS, WARM_START_ITERATIONS, MAX_HALVINGS = 50, 3, 30
BOUND_TOLERANCE = 1e-6  # a parameter as close to its bound, as a share of it, is held there
TOLERANCE = 1e-14  # gains below this share of the log-likelihood are rounding


@dataclass(frozen=True, slots=True, eq=False)
class ExponentialFamily:
    """Laws p(s) proportional to exp(statistics(s) . theta + base(s)), s >= 1; statistics are not negative.

    theta[:, k] is kept between lower[:, k] and upper[:, k].
    """

    sufficient_statistics: Callable[[Float[Array, " S"]], Float[Array, "S Q"]]
    base: Callable[[Float[Array, " S"]], Float[Array, "S #K"]]
    lower: Float[Array, "Q K"]
    upper: Float[Array, "Q K"]


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """Of each state's visits: the log-likelihood, its gradient, and what they tell of theta.

    information is minus the Hessian, complete what it would be had nothing been cut off.
    """

    value: Float[Array, " K"]
    gradient: Float[Array, "Q K"]
    information: Float[Array, "K Q Q"]
    complete_information: Float[Array, "K Q Q"]


def fit_parameters(
    family: ExponentialFamily, segments: Segments, start: Float[Array, "Q K"], warm_start: bool
) -> Float[Array, "Q K"]:
    """Theta of the largest likelihood, by Newton steps within the bounds; never less likely than start.

    Going on from the law before, a few steps will do: expectation-maximisation comes back.
    With whole visits alone the likelihood is concave and the result its one maximum; else it is a maximum.
    Source: Bertsekas 1982, projected Newton methods; Louis 1982 for the information of what was cut off.
    """
    theta, current = start, evaluate_likelihood(family, segments, start)
    for _ in range(WARM_START_ITERATIONS if warm_start else MAX_ITERATIONS):
        step = _newton_direction(family, theta, current)
        gains = 0.5 * (step * current.gradient).sum(axis=0)  # what a quadratic likelihood would gain
        if (converged := gains <= TOLERANCE * (1.0 + np.abs(current.value))).all():
            break
        theta, current = _line_search(family, segments, theta, current, np.where(converged, 0.0, step), gains)
    return theta


def evaluate_likelihood(
    family: ExponentialFamily, segments: Segments, theta: Float[Array, "Q K"]
) -> Likelihood:
    """The log-likelihood of whole visits log p(s), of those cut off log p(s >= d), and so on, at theta."""
    quadrature = make_quadrature(
        lambda s: family.sufficient_statistics(s) @ theta + family.base(s), len(segments.uncensored)
    )
    X = family.sufficient_statistics(quadrature.steps)  # (N, Q)
    log_w = X @ theta + family.base(quadrature.steps) + quadrature.log_counts[:, None]
    log_p = log_w - log_sum_exp(log_w)
    log_longer = log_p + np.log(quadrature.steps)[:, None]
    log_mean = log_sum_exp(log_longer)
    left_censored_counts = (segments.left_censored + segments.doubly_censored).sum(
        axis=0
    )  # those met at a random one of their steps
    not_left_censored = (segments.uncensored + segments.right_censored).sum(axis=0)
    expected, spread = _moments(X, np.exp(log_p))
    expected_met, spread_met = _moments(X, np.exp(log_longer - log_mean))
    value = (segments.uncensored * log_p[: len(segments.uncensored)]).sum(
        axis=0
    ) - left_censored_counts * log_mean
    gradient = (
        X[: len(segments.uncensored)].T @ segments.uncensored
        - not_left_censored * expected
        - left_censored_counts * expected_met
    )
    complete_information = (
        not_left_censored[:, None, None] * spread + left_censored_counts[:, None, None] * spread_met
    )
    missing = np.zeros_like(complete_information)
    for counts, order in (
        (segments.right_censored + segments.left_censored, 1),
        (segments.doubly_censored, 2),
    ):
        if counts.any():
            part = _censored_terms(X, log_p, counts, quadrature, order)
            value, gradient, missing = value + part[0], gradient + part[1], missing + part[2]
    return Likelihood(value, gradient, complete_information - missing, complete_information)


def _moments(
    X: Float[Array, "N Q"], p: Float[Array, "N K"]
) -> tuple[Float[Array, "Q K"], Float[Array, "K Q Q"]]:
    """Mean and covariance of the statistics under each law."""
    means = X.T @ p
    return means, _second_moments(X, p) - means.T[:, :, None] * means.T[:, None, :]


def _second_moments(X: Float[Array, "N Q"], weights: Float[Array, "N K"]) -> Float[Array, "K Q Q"]:
    """Weighted sums of the statistics' products."""
    Q = X.shape[1]
    products = (X[:, :, None] * X[:, None, :]).reshape(len(X), Q * Q)
    return np.asarray(weights.T @ products).reshape(-1, Q, Q)


def _censored_terms(
    X: Float[Array, "N Q"],
    log_p: Float[Array, "N K"],
    counts: Float[Array, "S K"],
    quadrature: Quadrature,
    order: int,
) -> tuple[Float[Array, " K"], Float[Array, "Q K"], Float[Array, "K Q Q"]]:
    """What visits add of which only d steps were seen: value, gradient, and the information that is missing.

    order 1 where p(s >= d) is what was seen, order 2 where it is the sum of that over d and all above.
    """
    S = len(counts)
    log_tail = log_reverse_cumsum(log_p, quadrature, S, order)
    completed = _complete_segments(log_p, counts, log_tail, quadrature, order)
    with np.errstate(divide="ignore"):
        log_X = np.log(X)
    M = np.stack(  # expected statistics given d, (Q, S, K)
        [
            np.exp(log_reverse_cumsum(log_p + log_x[:, None], quadrature, S, order) - log_tail)
            for log_x in log_X.T
        ]
    )
    missing = _second_moments(X, completed) - np.einsum("ask,bsk,sk->kab", M, M, counts)
    return (counts * log_tail).sum(axis=0), X.T @ completed, missing


def complete_segments(
    log_p: Float[Array, "N K"], segments: Segments, quadrature: Quadrature | None = None
) -> Float[Array, "N K"]:
    """All visits, those cut off spread over the lengths that they may have had.

    exp log_p is what each step of the rule holds; without a rule they are s = 1 ... N, and nothing is longer.
    """
    quadrature = quadrature or single_step_quadrature(len(log_p))
    total = np.zeros_like(log_p)
    total[: len(segments.uncensored)] = segments.uncensored
    for counts, order in (
        (segments.right_censored + segments.left_censored, 1),
        (segments.doubly_censored, 2),
    ):
        if counts.any():
            log_tail = log_reverse_cumsum(log_p, quadrature, len(counts), order)
            total += _complete_segments(log_p, counts, log_tail, quadrature, order)
    return total


def _complete_segments(
    log_p: Float[Array, "N K"],
    counts: Float[Array, "S K"],
    log_tail: Float[Array, "S K"],
    quadrature: Quadrature,
    order: int,
) -> Float[Array, "N K"]:
    """Visits of which only d steps were seen, by how long they may have lasted."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log_share = np.where(counts > 0.0, np.log(counts) - log_tail, -np.inf)
    return np.asarray(np.exp(log_cumsum(log_share, quadrature, order) + log_p))


def _line_search(
    family: ExponentialFamily,
    segments: Segments,
    theta: Float[Array, "Q K"],
    current: Likelihood,
    step: Float[Array, "Q K"],
    gains: Float[Array, " K"],
) -> tuple[Float[Array, "Q K"], Likelihood]:
    """A step for every state, halved for those that would lose by it, and none where that is of no use."""
    # Parameters that must stay below zero, where tails become endless, come no closer than half way at once.
    within = np.where(family.upper < 0.0, np.minimum(family.upper, 0.5 * theta), family.upper)
    share = _step_to_bound(theta, step, family.lower, within)
    for _ in range(MAX_HALVINGS):
        candidate = np.clip(theta + share * step, family.lower, within)
        candidate = np.where(step == 0.0, theta, candidate)
        result = evaluate_likelihood(family, segments, candidate)
        worse = ~(result.value >= current.value)
        if not worse.any():
            return candidate, result
        share = np.where(worse, 0.5 * share, share)
        if not (worse & (share * gains > TOLERANCE * (1.0 + np.abs(current.value)))).any():
            break
    candidate = np.where(worse, theta, candidate)
    return candidate, evaluate_likelihood(family, segments, candidate)


def _step_to_bound(
    theta: Float[Array, "Q K"], step: Float[Array, "Q K"], low: Float[Array, "Q K"], high: Float[Array, "Q K"]
) -> Float[Array, " K"]:
    """The share of each state's step that ends at a bound ahead, or all; bounds already reached only clip.

    A step bent by a bound need not lead upwards.
    """
    bound = np.where(step < 0.0, low, high)
    ahead = (step != 0.0) & (np.abs(bound - theta) > BOUND_TOLERANCE * np.abs(theta))
    step_fraction = np.divide(bound - theta, step, out=np.ones_like(step), where=ahead)
    return np.asarray(np.minimum(1.0, step_fraction.min(axis=0)))


def _newton_direction(
    family: ExponentialFamily, theta: Float[Array, "Q K"], current: Likelihood
) -> Float[Array, "Q K"]:
    """Newton's, of the parameters that no bound holds; where the Hessian is no help, that of whole visits."""
    low = np.isfinite(family.lower) & (theta - family.lower <= BOUND_TOLERANCE * np.abs(family.lower))
    high = np.isfinite(family.upper) & (family.upper - theta <= BOUND_TOLERANCE * np.abs(family.upper))
    at_bound = (low & (current.gradient < 0)) | (high & (current.gradient > 0))
    gradient = np.where(at_bound, 0.0, current.gradient).T  # (K, Q)
    # A law on one length alone has no variance but rounding: then the gradient says how far to go.
    least = np.maximum(1e-6 * np.abs(gradient), 1e-100)
    scale = np.sqrt(np.maximum(np.diagonal(current.complete_information, axis1=1, axis2=2), least))  # (K, Q)
    scales = scale[:, :, None] * scale[:, None, :]
    observed_information, whole = (
        _mask_fixed(matrix / scales, at_bound.T)
        for matrix in (current.information, current.complete_information)
    )
    well_conditioned = np.linalg.eigvalsh(observed_information)[:, 0] > 1e-6
    chosen = np.where(well_conditioned[:, None, None], observed_information, whole) + 1e-12 * np.eye(
        len(theta)
    )
    return np.asarray((np.linalg.solve(chosen, (gradient / scale)[:, :, None])[:, :, 0] / scale).T)


def _mask_fixed(matrix: Float[Array, "K Q Q"], at_bound: Bool[Array, "K Q"]) -> Float[Array, "K Q Q"]:
    """The same of parameters that are free, the identity of those that are held."""
    free = ~(at_bound[:, :, None] | at_bound[:, None, :])
    return np.asarray(np.where(free, matrix, np.eye(matrix.shape[1])))
