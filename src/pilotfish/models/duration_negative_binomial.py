"""The most likely negative binomial durations of expected visits."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.models.durations import Durations, NegativeBinomialDurations
from pilotfish.models.durations_fit import Family, completed_visits, evaluated, most_likely
from pilotfish.models.durations_rule import rule_for
from pilotfish.models.durations_sums import log_sum
from pilotfish.models.visits import Visits, lengths_seen
from pilotfish.types import Array, Float

LEAST_SHAPE, MOST_SHAPE = 1e-2, 1e4
STAYING = (1e-6, 1.0 - 1e-4)  # what 1 - leaving may be
BEYOND = 10.0  # more steps than so many times the longest visit that is followed are not expected
ROUNDS, MORE_ROUNDS = 20, 1
STRIDE, SECANTS, CLOSE = 0.1, 50, 1e-9  # of logarithms of shapes
ENOUGH = 1e-10  # gains below this share of the log-likelihood end the rounds


@dataclass(frozen=True, slots=True)
class NegativeBinomial:
    """NegativeBinomialDurations of any shape from .01 to 10,000, or of one shape for all states.

    shape  1 keeps the durations geometric, as a Markov chain's are; None lets each state have its own
    """

    shape: float | None = None

    def __post_init__(self) -> None:
        if self.shape is not None and not LEAST_SHAPE <= self.shape <= MOST_SHAPE:
            raise InvalidInput(f"shape is {self.shape}, expected {LEAST_SHAPE} to {MOST_SHAPE:g}, or None")

    @property
    def label(self) -> str:
        return f"negative binomial({self.shape:g})" if self.shape else "negative binomial"

    def estimate(self, visits: Visits, previous: Durations | None, floor: float) -> NegativeBinomialDurations:
        """The floor does not bear on it: its variance is never far below its mean.

        Shapes and the probabilities of leaving take turns: the shape that is best for visits spread over what
        they may have lasted, then the leaving that is best for the visits as seen. With whole visits
        that is the maximum; where many are cut off the shape approaches it over many calls.
        """
        shapes, staying = self._beginning(visits, previous)
        if self.shape is not None:
            best = most_likely(
                _family(shapes, staying, visits), visits, np.log(staying)[None], going_on=False
            )
            return _law(shapes, np.exp(best[0]))
        value = evaluated(_family(shapes, staying, visits), visits, np.log(staying)[None]).value
        for _ in range(MORE_ROUNDS if isinstance(previous, NegativeBinomialDurations) else ROUNDS):
            others = _best_shapes(visits, shapes, staying)
            more = shapes * staying / (1.0 - staying)
            near = np.clip(more / (more + others), *STAYING)  # of the same mean
            there = _best_staying(visits, others, near)
            found = evaluated(_family(others, near, visits), visits, np.log(there)[None]).value
            better = found >= value
            shapes, staying = np.where(better, others, shapes), np.where(better, there, staying)
            gain, value = np.where(better, found - value, 0.0), np.maximum(value, found)
            if (gain <= ENOUGH * (1.0 + np.abs(value))).all():
                break
        return _law(shapes, staying)

    def parameter_count(self, states: int, longest: int) -> int:
        return states if self.shape is not None else 2 * states

    def _beginning(
        self, visits: Visits, previous: Durations | None
    ) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
        if isinstance(previous, NegativeBinomialDurations):
            shapes = previous.shapes if self.shape is None else np.full_like(previous.shapes, self.shape)
            return shapes, np.clip(1.0 - previous.leaving, *STAYING)
        seen, variances = lengths_seen(visits)
        more = np.maximum(seen - 1.0, 1e-3)
        spread = np.maximum(variances - more, 1e-2 * more)
        free = np.clip(more**2 / spread, LEAST_SHAPE, MOST_SHAPE)
        shapes = free if self.shape is None else np.full_like(free, self.shape)
        return shapes, np.clip(more / (more + shapes), *STAYING)


def _law(shapes: Float[Array, " K"], staying: Float[Array, " K"]) -> NegativeBinomialDurations:
    return NegativeBinomialDurations(shapes, 1.0 - staying)


def _family(shapes: Float[Array, " K"], staying: Float[Array, " K"], visits: Visits) -> Family:
    """Of the logarithm of staying, shapes given; visits are short enough, or no longer than they were."""
    from scipy.special import gammaln  # here: scipy doubles the time of importing pilotfish

    def base(s: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(gammaln((s - 1)[:, None] + shapes) - gammaln(shapes) - gammaln(s)[:, None])

    most = BEYOND * len(visits.whole)
    high = np.maximum(np.minimum(STAYING[1], most / (most + shapes)), staying)
    low = np.full_like(shapes, STAYING[0])
    return Family(lambda s: s[:, None] - 1.0, base, np.log(low)[None], np.log(high)[None])


def _best_staying(
    visits: Visits, shapes: Float[Array, " K"], staying: Float[Array, " K"]
) -> Float[Array, " K"]:
    return np.asarray(
        np.exp(most_likely(_family(shapes, staying, visits), visits, np.log(staying)[None], going_on=True)[0])
    )


def _best_shapes(
    visits: Visits, shapes: Float[Array, " K"], staying: Float[Array, " K"]
) -> Float[Array, " K"]:
    """Shapes that suit the visits, spread over what they may have lasted, with the leaving that suits them.

    Where the likelihood rises with the shape up to the largest, as it does for visits that vary less than
    Poisson's, it is the largest.
    """
    from scipy.special import psi  # here: scipy doubles the time of importing pilotfish

    law = _law(shapes, staying)
    rule = rule_for(law.log_weights, len(visits.whole))
    log_w = law.log_weights(rule.steps) + rule.log_counts[:, None]
    counts = completed_visits(log_w - log_sum(log_w), visits, rule)
    met = (visits.had_begun + visits.fills).sum(axis=0)
    total, more = counts.sum(axis=0), rule.steps - 1.0

    def slope(log_r: Float[Array, " K"]) -> Float[Array, " K"]:
        r = np.exp(log_r)
        p = _best_leaving(r, total, more @ counts, met)
        mean = 1.0 + r * (1.0 - p) / p
        choices = ((psi(more[:, None] + r) - psi(r)) * counts).sum(axis=0)
        return np.asarray(choices + total * np.log(p) - met * (1.0 - p) / p / mean)

    found = np.exp(_falling_root(slope, np.log(shapes), np.log(LEAST_SHAPE), np.log(MOST_SHAPE)))
    return np.asarray(np.where(total > 0.0, np.clip(found, LEAST_SHAPE, MOST_SHAPE), shapes))


def _falling_root(
    slope: Callable[[Float[Array, " K"]], Float[Array, " K"]],
    start: Float[Array, " K"],
    low: float,
    high: float,
) -> Float[Array, " K"]:
    """Where slope, positive before and negative after it, is zero; or the end that it lies beyond.

    Secants from start, and halves of what is left where they leave it.
    """
    beyond = np.where(slope(np.full_like(start, high)) > 0.0, high, np.nan)
    beyond = np.where(slope(np.full_like(start, low)) < 0.0, low, beyond)
    before, after = np.full_like(start, low), np.full_like(start, high)
    x, value = start, slope(start)
    new = np.clip(x + np.where(value > 0.0, STRIDE, -STRIDE), low, high)
    for _ in range(SECANTS):
        before = np.where(value > 0.0, np.maximum(before, x), before)
        after = np.where(value > 0.0, after, np.minimum(after, x))
        new = np.where((new >= before) & (new <= after), new, 0.5 * (before + after))
        old, x = x, np.where(np.isnan(beyond), new, beyond)
        if (np.abs(x - old) < CLOSE).all():
            break
        here = slope(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            new, value = x - here * (x - old) / (here - value), here
        new = np.where(np.abs(x - old) < CLOSE, x, new)
    return x


def _best_leaving(
    r: Float[Array, " K"], total: Float[Array, " K"], more: Float[Array, " K"], met: Float[Array, " K"]
) -> Float[Array, " K"]:
    """The p of largest total r log p + more log(1 - p) - met log(1 + r (1 - p) / p): a root in (0, 1)."""
    fixed = total * r + met
    a = (1.0 - r) * (met - fixed - more)
    b = fixed * (1.0 - 2.0 * r) - more * r - met * (1.0 - r)
    root = np.sqrt(b * b - 4.0 * a * fixed * r)
    with np.errstate(invalid="ignore", divide="ignore"):
        p = 2.0 * fixed * r / (root - b)
    return np.asarray(np.clip(p, 1.0 - STAYING[1], 1.0 - STAYING[0]))
