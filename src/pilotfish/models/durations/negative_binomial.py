"""The most likely negative binomial durations of expected visits."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.models.durations.fit import (
    ExponentialFamily,
    complete_segments,
    evaluate_likelihood,
    fit_parameters,
)
from pilotfish.models.durations.quadrature import make_quadrature
from pilotfish.models.durations.sums import log_sum_exp
from pilotfish.models.durations.values import Durations, NegativeBinomialDurations
from pilotfish.models.segments import Segments, recorded_length_moments
from pilotfish.types import Array, Float

MIN_SHAPE, MAX_SHAPE = 1e-2, 1e4
STAY_PROB_BOUNDS = (1e-6, 1.0 - 1e-4)  # what 1 - leaving may be
MAX_RELATIVE_DURATION = (
    10.0  # more steps than so many times the longest visit that is followed are not expected
)
MAX_ITERATIONS, WARM_START_ITERATIONS = 20, 1
FIRST_STEP, MAX_SECANT_STEPS, ROOT_TOLERANCE = 0.1, 50, 1e-9  # of logarithms of shapes
TOLERANCE = 1e-10  # gains below this share of the log-likelihood end the rounds


@dataclass(frozen=True, slots=True)
class NegativeBinomial:
    """NegativeBinomialDurations of any shape from .01 to 10,000, or of one shape for all states.

    shape  1 keeps the durations geometric, as a Markov chain's are; None lets each state have its own
    """

    shape: float | None = None

    def __post_init__(self) -> None:
        if self.shape is not None and not MIN_SHAPE <= self.shape <= MAX_SHAPE:
            raise InvalidInput(f"shape is {self.shape}, expected {MIN_SHAPE} to {MAX_SHAPE:g}, or None")

    @property
    def label(self) -> str:
        return f"negative binomial({self.shape:g})" if self.shape else "negative binomial"

    def estimate(
        self, segments: Segments, previous: Durations | None, min_variance: float
    ) -> NegativeBinomialDurations:
        """The floor does not bear on it: its variance is never far below its mean.

        Shapes and the probabilities of leaving take turns: the shape that is best for visits spread over what
        they may have lasted, then the leaving that is best for the visits as seen. With whole visits
        that is the maximum; where many are cut off the shape approaches it over many calls.
        """
        shapes, stay_probs = self._initial_parameters(segments, previous)
        if self.shape is not None:
            best = fit_parameters(
                _make_family(shapes, stay_probs, segments),
                segments,
                np.log(stay_probs)[None],
                warm_start=False,
            )
            return _make_durations(shapes, np.exp(best[0]))
        value = evaluate_likelihood(
            _make_family(shapes, stay_probs, segments), segments, np.log(stay_probs)[None]
        ).value
        for _ in range(
            WARM_START_ITERATIONS if isinstance(previous, NegativeBinomialDurations) else MAX_ITERATIONS
        ):
            new_shapes = _fit_shapes(segments, shapes, stay_probs)
            more = shapes * stay_probs / (1.0 - stay_probs)
            start_stay_probs = np.clip(more / (more + new_shapes), *STAY_PROB_BOUNDS)  # of the same mean
            new_stay_probs = _fit_stay_probs(segments, new_shapes, start_stay_probs)
            new_value = evaluate_likelihood(
                _make_family(new_shapes, start_stay_probs, segments), segments, np.log(new_stay_probs)[None]
            ).value
            better = new_value >= value
            shapes, stay_probs = (
                np.where(better, new_shapes, shapes),
                np.where(better, new_stay_probs, stay_probs),
            )
            gain, value = np.where(better, new_value - value, 0.0), np.maximum(value, new_value)
            if (gain <= TOLERANCE * (1.0 + np.abs(value))).all():
                break
        return _make_durations(shapes, stay_probs)

    def parameter_count(self, states: int, max_duration: int) -> int:
        return states if self.shape is not None else 2 * states

    def _initial_parameters(
        self, segments: Segments, previous: Durations | None
    ) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
        if isinstance(previous, NegativeBinomialDurations):
            shapes = previous.shapes if self.shape is None else np.full_like(previous.shapes, self.shape)
            return shapes, np.clip(1.0 - previous.exit_probs, *STAY_PROB_BOUNDS)
        seen, variances = recorded_length_moments(segments)
        more = np.maximum(seen - 1.0, 1e-3)
        spread = np.maximum(variances - more, 1e-2 * more)
        free = np.clip(more**2 / spread, MIN_SHAPE, MAX_SHAPE)
        shapes = free if self.shape is None else np.full_like(free, self.shape)
        return shapes, np.clip(more / (more + shapes), *STAY_PROB_BOUNDS)


def _make_durations(shapes: Float[Array, " K"], stay_probs: Float[Array, " K"]) -> NegativeBinomialDurations:
    return NegativeBinomialDurations(shapes, 1.0 - stay_probs)


def _make_family(
    shapes: Float[Array, " K"], stay_probs: Float[Array, " K"], segments: Segments
) -> ExponentialFamily:
    """Of the logarithm of staying, shapes given; visits are short enough, or no longer than they were."""
    from scipy.special import gammaln  # here: scipy doubles the time of importing pilotfish

    def base(s: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(gammaln((s - 1)[:, None] + shapes) - gammaln(shapes) - gammaln(s)[:, None])

    most = MAX_RELATIVE_DURATION * len(segments.uncensored)
    high = np.maximum(np.minimum(STAY_PROB_BOUNDS[1], most / (most + shapes)), stay_probs)
    low = np.full_like(shapes, STAY_PROB_BOUNDS[0])
    return ExponentialFamily(lambda s: s[:, None] - 1.0, base, np.log(low)[None], np.log(high)[None])


def _fit_stay_probs(
    segments: Segments, shapes: Float[Array, " K"], stay_probs: Float[Array, " K"]
) -> Float[Array, " K"]:
    return np.asarray(
        np.exp(
            fit_parameters(
                _make_family(shapes, stay_probs, segments),
                segments,
                np.log(stay_probs)[None],
                warm_start=True,
            )[0]
        )
    )


def _fit_shapes(
    segments: Segments, shapes: Float[Array, " K"], stay_probs: Float[Array, " K"]
) -> Float[Array, " K"]:
    """Shapes that suit the visits, spread over what they may have lasted, with the leaving that suits them.

    Where the likelihood rises with the shape up to the largest, as it does for visits that vary less than
    Poisson's, it is the largest.
    """
    from scipy.special import psi  # here: scipy doubles the time of importing pilotfish

    durations = _make_durations(shapes, stay_probs)
    quadrature = make_quadrature(durations.log_weights, len(segments.uncensored))
    log_w = durations.log_weights(quadrature.steps) + quadrature.log_counts[:, None]
    counts = complete_segments(log_w - log_sum_exp(log_w), segments, quadrature)
    length_biased = (segments.left_censored + segments.doubly_censored).sum(axis=0)
    total, more = counts.sum(axis=0), quadrature.steps - 1.0

    def slope(log_r: Float[Array, " K"]) -> Float[Array, " K"]:
        r = np.exp(log_r)
        p = _fit_exit_probs(r, total, more @ counts, length_biased)
        mean = 1.0 + r * (1.0 - p) / p
        choices = ((psi(more[:, None] + r) - psi(r)) * counts).sum(axis=0)
        return np.asarray(choices + total * np.log(p) - length_biased * (1.0 - p) / p / mean)

    new_value = np.exp(_decreasing_root(slope, np.log(shapes), np.log(MIN_SHAPE), np.log(MAX_SHAPE)))
    return np.asarray(np.where(total > 0.0, np.clip(new_value, MIN_SHAPE, MAX_SHAPE), shapes))


def _decreasing_root(
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
    new = np.clip(x + np.where(value > 0.0, FIRST_STEP, -FIRST_STEP), low, high)
    for _ in range(MAX_SECANT_STEPS):
        before = np.where(value > 0.0, np.maximum(before, x), before)
        after = np.where(value > 0.0, after, np.minimum(after, x))
        new = np.where((new >= before) & (new <= after), new, 0.5 * (before + after))
        old, x = x, np.where(np.isnan(beyond), new, beyond)
        if (np.abs(x - old) < ROOT_TOLERANCE).all():
            break
        new_slope = slope(x)
        with np.errstate(divide="ignore", invalid="ignore"):
            new, value = x - new_slope * (x - old) / (new_slope - value), new_slope
        new = np.where(np.abs(x - old) < ROOT_TOLERANCE, x, new)
    return x


def _fit_exit_probs(
    r: Float[Array, " K"],
    total: Float[Array, " K"],
    more: Float[Array, " K"],
    length_biased: Float[Array, " K"],
) -> Float[Array, " K"]:
    """The p of largest total r log p + more log(1 - p) - met log(1 + r (1 - p) / p): a root in (0, 1)."""
    fixed = total * r + length_biased
    a = (1.0 - r) * (length_biased - fixed - more)
    b = fixed * (1.0 - 2.0 * r) - more * r - length_biased * (1.0 - r)
    root = np.sqrt(b * b - 4.0 * a * fixed * r)
    with np.errstate(invalid="ignore", divide="ignore"):
        p = 2.0 * fixed * r / (root - b)
    return np.asarray(np.clip(p, 1.0 - STAY_PROB_BOUNDS[1], 1.0 - STAY_PROB_BOUNDS[0]))
