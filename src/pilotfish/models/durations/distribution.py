"""Base class of duration distributions.

A subclass holds the parameters of all K states as arrays and gives its unnormalised log-probabilities,
`log_weights`. The base class sums these over all whole steps s = 1, 2, ...; the sums are exact to about
1e-12, also for heavy tails (`quadrature.py`). To add a distribution, write one file with one subclass and
add the class to `registry.py`: command line, skill files and documentation take it from there.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, ClassVar, TypeVar, cast

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.models.durations.segments import Segments
from pilotfish.models.durations.sums import (
    log_probs,
    log_survival_from_weights,
    max_duration_from_weights,
    mean_and_deviation,
)
from pilotfish.types import Array, Bool, Float

Result = TypeVar("Result")

MIN_DIVISOR = 1e-12  # of parameters that are divided by
MAX_CACHED = 32  # results of log_survival and max_duration that are kept
MAX_CACHED_SIZE = 2**14  # numbers in an array that is kept
_CACHE: dict[tuple[Any, ...], Any] = {}
MAX_RELATIVE_DURATION = 10.0  # bound of fitted means and deviations, relative to the maximum duration


class DurationDistribution(ABC):
    """Distribution of the number of steps that each of K states lasts; subclasses hold its parameters.

    Class attributes:
        name: Name on the command line, in files and in tables.
        options: Options of `fit` by name, with their smallest and largest value.
    """

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]
    options: ClassVar[Mapping[str, tuple[float, float]]] = {}

    @classmethod
    @abstractmethod
    def fit(
        cls, segments: Segments, previous: "DurationDistribution | None" = None, min_variance: float = 1.0
    ) -> "DurationDistribution":
        """Estimate the parameters of every state from expected segments (M-step).

        Args:
            segments: Expected segments, censored ones included.
            previous: Distribution of the previous iteration; the result is at least as likely. A state
                without segments keeps its parameters.
            min_variance: Lower bound of the variance of a distribution with a free width [steps^2], positive.

        Returns:
            A distribution of this class.
        """

    @abstractmethod
    def log_weights(self, steps: Float[Array, " S"]) -> Float[Array, "S K"]:
        """Return log p(s) up to a constant per state.

        Args:
            steps: Durations s, whole or not, at least 1.

        Returns:
            Log-weights; the steps of a state are contiguous in memory, which makes long sums fast.
        """

    @property
    def means(self) -> Float[Array, " K"]:
        """Return the mean duration of every state [steps]."""
        return mean_and_deviation(self.log_weights)[0]

    @property
    def deviations(self) -> Float[Array, " K"]:
        """Return the standard deviation of the duration of every state [steps]."""
        return mean_and_deviation(self.log_weights)[1]

    def log_table(self, max_duration: int) -> Float[Array, "S K"]:
        """Return log p(s) for s = 1 .. max_duration, normalised over all s >= 1.

        Args:
            max_duration: Number of rows [steps].
        """
        return log_probs(self.log_weights, max_duration)

    def log_survival(self, max_duration: int) -> tuple[Float[Array, "S K"], Float[Array, "S K"]]:
        """Compute the survival function and its sum, in logarithms that stay exact far below 1e-308.

        Args:
            max_duration: Number of rows [steps].

        Returns:
            log S(d) = log p(duration >= d) and log (S(d) + S(d + 1) + ...) for d = 1 .. max_duration; the
            second at d = 1 is the log of the mean duration.
        """
        return _cached(self, max_duration, log_survival_from_weights)

    def max_duration(self, tail_probability: float) -> int:
        """Return the smallest duration that every state exceeds with at most this probability [steps].

        Args:
            tail_probability: Probability of a longer segment.
        """
        return _cached(self, tail_probability, max_duration_from_weights)

    def degrees_of_freedom(self, states: Bool[Array, " K"], fixed_parameters: int = 0) -> int:
        """Return the number of free parameters of the given states.

        Args:
            states: Whether each state counts.
            fixed_parameters: Parameters of each state that the fit held fixed.
        """
        return (len(fields(self)) - fixed_parameters) * int(states.sum())

    @abstractmethod
    def validate(self) -> None:
        """Raise InvalidInput unless the parameters define a distribution."""


def _cached(durations: DurationDistribution, argument: int | float, compute: Callable[..., Result]) -> Result:
    """Return compute(durations.log_weights, argument), from the cache if a recent call had the same values.

    The forward variables of one skill need the same short tables again and again. The key holds the values
    of the parameters, since a caller may change an array in place.
    """
    values = [getattr(durations, field.name) for field in fields(durations)]
    key = (type(durations), compute, argument, *(value.tobytes() for value in values))
    if (cached := _CACHE.get(key)) is not None:  # read once: another thread may clear the cache
        return cast(Result, cached)
    result = compute(durations.log_weights, argument)
    for array in result if isinstance(result, tuple) else ():
        array.flags.writeable = False
    if argument * values[0].size <= MAX_CACHED_SIZE:
        if len(_CACHE) >= MAX_CACHED:
            _CACHE.clear()
        _CACHE[key] = result
    return result


def require_positive(values: Float[Array, " K"], name: str) -> None:
    """Raise InvalidInput unless every value can be divided by."""
    if (bad := np.flatnonzero(~(values > MIN_DIVISOR))).size:
        raise InvalidInput(f"{name}[{bad[0]}] is {values[bad[0]]}, expected more than {MIN_DIVISOR:g}")
