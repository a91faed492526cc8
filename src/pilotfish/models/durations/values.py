"""How long a visit to a state lasts: laws on whole steps s = 1, 2, ..., their parameters state by state.

Every law has means and deviations [steps], those of its probabilities (of the normal law alone they are its
parameters, those of the density before it is cut); log_table(longest), where table[s - 1, k] = log p(a visit
to k lasts s steps), s = 1 ... longest, normalised over all s >= 1; and longest(lost), the least number of
steps that a visit to any state outlasts with probability at most lost.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish.models.durations.sums import (
    log_probs,
    max_duration_from_probs,
    max_duration_from_weights,
    mean_and_deviation,
)
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class GaussianDurations:
    """The density of N(mean, deviation^2) at whole steps s >= 1, normalised over them.

    means and deviations [steps] are those of the density, before it is cut.
    """

    means: Float[Array, " K"]
    deviations: Float[Array, " K"]

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(-0.5 * ((steps[:, None] - self.means) / self.deviations) ** 2)

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        return log_probs(self.log_weights, max_duration)

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_weights(self.log_weights, tail_probability)


@dataclass(frozen=True, slots=True, eq=False)
class LogNormalDurations:
    """The density at whole steps s >= 1 that makes log s normal, normalised over them.

    log_means and log_deviations are those of log s, before the density is cut.
    """

    log_means: Float[Array, " K"]
    log_deviations: Float[Array, " K"]

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        log_s = np.log(steps)[:, None]
        return np.asarray(-0.5 * ((log_s - self.log_means) / self.log_deviations) ** 2 - log_s)

    @property
    def means(self) -> Float[Array, " K"]:
        return mean_and_deviation(self.log_weights)[0]

    @property
    def deviations(self) -> Float[Array, " K"]:
        return mean_and_deviation(self.log_weights)[1]

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        return log_probs(self.log_weights, max_duration)

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_weights(self.log_weights, tail_probability)


@dataclass(frozen=True, slots=True, eq=False)
class GammaDurations:
    """The density s^(shape - 1) e^(-rate s) at whole steps s >= 1, normalised over them; rates [1/step]."""

    shapes: Float[Array, " K"]
    rates: Float[Array, " K"]

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        return np.asarray(np.log(steps)[:, None] * (self.shapes - 1.0) - steps[:, None] * self.rates)

    @property
    def means(self) -> Float[Array, " K"]:
        return mean_and_deviation(self.log_weights)[0]

    @property
    def deviations(self) -> Float[Array, " K"]:
        return mean_and_deviation(self.log_weights)[1]

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        return log_probs(self.log_weights, max_duration)

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_weights(self.log_weights, tail_probability)


@dataclass(frozen=True, slots=True, eq=False)
class PoissonDurations:
    """One step, and as many more as a Poisson law of mean `more` says."""

    rates: Float[Array, " K"]

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        from scipy.special import gammaln  # here: scipy doubles the time of importing pilotfish

        return np.asarray((steps - 1)[:, None] * np.log(self.rates) - gammaln(steps)[:, None])

    @property
    def means(self) -> Float[Array, " K"]:
        return 1.0 + self.rates

    @property
    def deviations(self) -> Float[Array, " K"]:
        return np.asarray(np.sqrt(self.rates))

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        return log_probs(self.log_weights, max_duration)

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_weights(self.log_weights, tail_probability)


@dataclass(frozen=True, slots=True, eq=False)
class NegativeBinomialDurations:
    """One step, and as many more as a negative binomial law says.

    p(s) = Gamma(s - 1 + shape) / (Gamma(shape) (s - 1)!) leaving^shape (1 - leaving)^(s - 1). With shape one
    it is the geometric law of a Markov chain, leaving the probability of a step to another state.
    """

    shapes: Float[Array, " K"]
    exit_probs: Float[Array, " K"]

    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        from scipy.special import gammaln  # here: scipy doubles the time of importing pilotfish

        rates = (steps - 1)[:, None]
        choices = gammaln(rates + self.shapes) - gammaln(self.shapes) - gammaln(steps)[:, None]
        return np.asarray(choices + rates * np.log1p(-self.exit_probs))

    @property
    def means(self) -> Float[Array, " K"]:
        return np.asarray(1.0 + self.shapes * (1.0 - self.exit_probs) / self.exit_probs)

    @property
    def deviations(self) -> Float[Array, " K"]:
        return np.asarray(np.sqrt(self.shapes * (1.0 - self.exit_probs)) / self.exit_probs)

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        return log_probs(self.log_weights, max_duration)

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_weights(self.log_weights, tail_probability)


@dataclass(frozen=True, slots=True, eq=False)
class HistogramDurations:
    """Any probabilities of s = 1 ... S steps, columns summing to one; nothing lasts longer."""

    probabilities: Float[Array, "S K"]

    @property
    def means(self) -> Float[Array, " K"]:
        return np.asarray(np.arange(1.0, len(self.probabilities) + 1) @ self.probabilities)

    @property
    def deviations(self) -> Float[Array, " K"]:
        away = np.arange(1.0, len(self.probabilities) + 1)[:, None] - self.means
        return np.asarray(np.sqrt((np.square(away) * self.probabilities).sum(axis=0)))

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        S, K = self.probabilities.shape
        table = np.full((max_duration, K), -np.inf)
        with np.errstate(divide="ignore"):
            table[:S] = np.log(self.probabilities[:max_duration])
        return table

    def max_duration(self, tail_probability: float) -> int:
        return max_duration_from_probs(self.probabilities, tail_probability)


Durations = (
    GaussianDurations
    | LogNormalDurations
    | GammaDurations
    | PoissonDurations
    | NegativeBinomialDurations
    | HistogramDurations
)
