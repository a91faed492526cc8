"""Shifted negative binomial durations.

The likelihood is fitted by coordinate ascent: for fixed shapes the distribution is an exponential family in
log(1 - exit probability), which `fit_parameters` maximises; for fixed completed segments the best shape is a
root of the derivative, found by a safeguarded secant method with the best exit probability in closed form.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish.models.durations.distribution import (
    MAX_RELATIVE_DURATION,
    DurationDistribution,
    require_positive,
)
from pilotfish.models.durations.fit import (
    ExponentialFamily,
    complete_segments,
    evaluate_likelihood,
    fit_parameters,
)
from pilotfish.models.durations.quadrature import make_quadrature
from pilotfish.models.durations.segments import Segments
from pilotfish.models.durations.sums import log_sum_exp
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, shorten_repr

MIN_SHAPE, MAX_SHAPE = 1e-2, 1e4
STAY_PROB_BOUNDS = (1e-6, 1.0 - 1e-4)  # of 1 - exit probability
MAX_ITERATIONS, WARM_START_ITERATIONS = 20, 1
FIRST_STEP, MAX_SECANT_STEPS, ROOT_TOLERANCE = 0.1, 50, 1e-9  # of log shapes
TOLERANCE = 1e-10  # relative gain of the log-likelihood that ends the iterations


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class NegativeBinomial(DurationDistribution):
    """One step, followed by a negative binomial number of steps.

    p(s) = Gamma(s - 1 + r) / (Gamma(r) (s - 1)!) q^r (1 - q)^(s - 1) with shape r and exit probability q.
    With r = 1 it is geometric, as in a Markov chain.

    Attributes:
        shapes: Shape r of every state, from 0.01 to 10,000.
        exit_probs: Exit probability q of every state.
    """

    name: ClassVar[str] = "negative-binomial"
    options: ClassVar[Mapping[str, tuple[float, float]]] = {"shape": (MIN_SHAPE, MAX_SHAPE)}
    shapes: Float[Array, " K"]
    exit_probs: Float[Array, " K"]

    @classmethod
    def fit(
        cls,
        segments: Segments,
        previous: DurationDistribution | None = None,
        min_variance: float = 1.0,
        *,
        shape: float | None = None,
    ) -> "NegativeBinomial":
        """Estimate the parameters from expected segments.

        With uncensored segments alone the result is the maximum. With many censored segments the shape
        approaches it over several calls, each warm-started by `previous`.

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration.
            min_variance: Not used: the variance is never below the mean minus one.
            shape: Fixed shape of all states; 1 gives geometric durations. By default every shape is fitted.

        Returns:
            The maximum-likelihood distribution.

        Raises:
            InvalidInput: If shape is out of range.
        """
        if shape is not None:
            require_number(shape, "shape", MIN_SHAPE, MAX_SHAPE)
        shapes, stay_probs = cls._initial_parameters(segments, previous, shape)
        if shape is None:
            warm_start = isinstance(previous, NegativeBinomial)
            shapes, stay_probs = _coordinate_ascent(segments, shapes, stay_probs, warm_start)
        else:
            stay_probs = _fit_stay_probs(segments, shapes, stay_probs, warm_start=False)
        return cls(shapes, 1.0 - stay_probs)

    @classmethod
    def _initial_parameters(
        cls, segments: Segments, previous: DurationDistribution | None, shape: float | None
    ) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
        if isinstance(previous, cls):
            shapes = previous.shapes if shape is None else np.full_like(previous.shapes, shape)
            return shapes, np.clip(1.0 - previous.exit_probs, *STAY_PROB_BOUNDS)
        recorded_means, variances = segments.recorded_length_moments()
        extra = np.maximum(recorded_means - 1.0, 1e-3)
        overdispersion = np.maximum(variances - extra, 1e-2 * extra)
        moment_shapes = np.clip(extra**2 / overdispersion, MIN_SHAPE, MAX_SHAPE)
        shapes = moment_shapes if shape is None else np.full_like(moment_shapes, shape)
        return shapes, np.clip(extra / (extra + shapes), *STAY_PROB_BOUNDS)

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        from scipy.special import gammaln  # not at the top: importing scipy doubles the import time

        extra, shapes = steps - 1, self.shapes[:, None]
        log_choices = gammaln(extra + shapes) - gammaln(shapes) - gammaln(steps)
        return np.asarray(log_choices + np.outer(np.log1p(-self.exit_probs), extra)).T

    @property
    def means(self) -> Float[Array, " K"]:
        return np.asarray(1.0 + self.shapes * (1.0 - self.exit_probs) / self.exit_probs)

    @property
    def deviations(self) -> Float[Array, " K"]:
        return np.asarray(np.sqrt(self.shapes * (1.0 - self.exit_probs)) / self.exit_probs)

    def validate(self) -> None:
        require_positive(self.shapes, "durations.shapes")
        require_positive(self.exit_probs, "durations.exit_probs")
        require_positive(1.0 - self.exit_probs, "1 - durations.exit_probs")


def _coordinate_ascent(
    segments: Segments, shapes: Float[Array, " K"], stay_probs: Float[Array, " K"], warm_start: bool
) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Update shapes and exit probabilities in turn; a state that would lose keeps its parameters."""
    value = _log_likelihood(segments, shapes, stay_probs, stay_probs)
    for _ in range(WARM_START_ITERATIONS if warm_start else MAX_ITERATIONS):
        new_shapes = _fit_shapes(segments, shapes, stay_probs)
        extra = shapes * stay_probs / (1.0 - stay_probs)
        start = np.clip(extra / (extra + new_shapes), *STAY_PROB_BOUNDS)  # has the same mean
        new_stay_probs = _fit_stay_probs(segments, new_shapes, start, warm_start=True)
        new_value = _log_likelihood(segments, new_shapes, new_stay_probs, start)
        better = new_value >= value
        shapes, stay_probs = (
            np.where(better, new_shapes, shapes),
            np.where(better, new_stay_probs, stay_probs),
        )
        gain, value = np.where(better, new_value - value, 0.0), np.maximum(value, new_value)
        if (gain <= TOLERANCE * (1.0 + np.abs(value))).all():
            break
    return shapes, stay_probs


def _make_family(
    shapes: Float[Array, " K"], stay_probs: Float[Array, " K"], segments: Segments
) -> ExponentialFamily:
    """Return the exponential family in log(stay probability) for fixed shapes.

    Means are at most 10 times the maximum duration, unless those of stay_probs are longer already.
    """
    from scipy.special import gammaln

    def base(s: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(gammaln((s - 1)[:, None] + shapes) - gammaln(shapes) - gammaln(s)[:, None])

    max_mean = MAX_RELATIVE_DURATION * len(segments.uncensored)
    high = np.maximum(np.minimum(STAY_PROB_BOUNDS[1], max_mean / (max_mean + shapes)), stay_probs)
    low = np.full_like(shapes, STAY_PROB_BOUNDS[0])
    return ExponentialFamily(lambda s: s[:, None] - 1.0, base, np.log(low)[None], np.log(high)[None])


def _log_likelihood(
    segments: Segments,
    shapes: Float[Array, " K"],
    stay_probs: Float[Array, " K"],
    start: Float[Array, " K"],
) -> Float[Array, " K"]:
    family = _make_family(shapes, start, segments)
    return evaluate_likelihood(family, segments, np.log(stay_probs)[None])[0]


def _fit_stay_probs(
    segments: Segments, shapes: Float[Array, " K"], start: Float[Array, " K"], *, warm_start: bool
) -> Float[Array, " K"]:
    family = _make_family(shapes, start, segments)
    return np.asarray(np.exp(fit_parameters(family, segments, np.log(start)[None], warm_start)[0]))


def _fit_shapes(
    segments: Segments, shapes: Float[Array, " K"], stay_probs: Float[Array, " K"]
) -> Float[Array, " K"]:
    """Maximise the likelihood of the completed segments over the shapes, each with its best exit probability.

    Segments that vary less than Poisson segments get the largest shape.
    """
    from scipy.special import psi

    durations = NegativeBinomial(shapes, 1.0 - stay_probs)
    quadrature = make_quadrature(durations.log_weights, len(segments.uncensored))
    log_w = durations.log_weights(quadrature.steps) + quadrature.log_counts[:, None]
    counts = complete_segments(log_w - log_sum_exp(log_w), segments, quadrature)
    length_biased = (segments.left_censored + segments.doubly_censored).sum(axis=0)
    total, extra = counts.sum(axis=0), quadrature.steps - 1.0

    def slope(log_r: Float[Array, " K"]) -> Float[Array, " K"]:
        r = np.exp(log_r)
        p = _fit_exit_probs(r, total, extra @ counts, length_biased)
        mean = 1.0 + r * (1.0 - p) / p
        choices = ((psi(extra[:, None] + r) - psi(r)) * counts).sum(axis=0)
        return np.asarray(choices + total * np.log(p) - length_biased * (1.0 - p) / p / mean)

    new_value = np.exp(_decreasing_root(slope, np.log(shapes), np.log(MIN_SHAPE), np.log(MAX_SHAPE)))
    return np.asarray(np.where(total > 0.0, np.clip(new_value, MIN_SHAPE, MAX_SHAPE), shapes))


def _decreasing_root(
    slope: Callable[[Float[Array, " K"]], Float[Array, " K"]],
    start: Float[Array, " K"],
    low: float,
    high: float,
) -> Float[Array, " K"]:
    """Find the root of a decreasing function in [low, high], or the bound beyond which it lies.

    Secant steps from start; a step that leaves the bracket is replaced by bisection.
    """
    bound = np.where(slope(np.full_like(start, high)) > 0.0, high, np.nan)
    bound = np.where(slope(np.full_like(start, low)) < 0.0, low, bound)
    left, right = np.full_like(start, low), np.full_like(start, high)
    x, value = start, slope(start)
    new = np.clip(x + np.where(value > 0.0, FIRST_STEP, -FIRST_STEP), low, high)
    for _ in range(MAX_SECANT_STEPS):
        left = np.where(value > 0.0, np.maximum(left, x), left)
        right = np.where(value > 0.0, right, np.minimum(right, x))
        new = np.where((new >= left) & (new <= right), new, 0.5 * (left + right))
        old, x = x, np.where(np.isnan(bound), new, bound)
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
    extra: Float[Array, " K"],
    length_biased: Float[Array, " K"],
) -> Float[Array, " K"]:
    """Maximise total r log p + extra log(1 - p) - length_biased log(1 + r (1 - p) / p) over p in (0, 1)."""
    fixed = total * r + length_biased
    a = (1.0 - r) * (length_biased - fixed - extra)
    b = fixed * (1.0 - 2.0 * r) - extra * r - length_biased * (1.0 - r)
    root = np.sqrt(b * b - 4.0 * a * fixed * r)
    with np.errstate(invalid="ignore", divide="ignore"):
        p = 2.0 * fixed * r / (root - b)
    return np.asarray(np.clip(p, 1.0 - STAY_PROB_BOUNDS[1], 1.0 - STAY_PROB_BOUNDS[0]))
