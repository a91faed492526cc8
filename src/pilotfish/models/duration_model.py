"""How the durations of a semi-Markov chain are fitted: distribution, censoring and longest segment."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from pilotfish.errors import InvalidInput
from pilotfish.models.durations import DurationDistribution, Gaussian, Segments
from pilotfish.validation import require_count, require_number, require_type

MAX_DURATION = 2**31 - 1  # steps


class Censoring(StrEnum):
    """Which ends of a recording may cut off a segment.

    RIGHT is usual: a recording begins with a segment and may end inside one. LEFT: it begins inside a
    segment, at a random step of it, and ends with one. BOTH and NONE accordingly.
    """

    RIGHT = "right"
    LEFT = "left"
    BOTH = "both"
    NONE = "none"

    @property
    def left(self) -> bool:
        """Return whether a recording begins inside a segment."""
        return self in (Censoring.LEFT, Censoring.BOTH)

    @property
    def right(self) -> bool:
        """Return whether a recording may end inside a segment."""
        return self in (Censoring.RIGHT, Censoring.BOTH)

    def with_right(self) -> "Censoring":
        """Return the same left end, with a right end that may cut off a segment."""
        return Censoring.BOTH if self.left else Censoring.RIGHT


@dataclass(frozen=True, slots=True)
class DurationModel:
    """How the durations of a semi-Markov chain are fitted.

    Attributes:
        distribution: Class of the duration distribution, such as `pf.durations.LogNormal`.
        censoring: Which ends of the recordings may cut off a segment.
        max_duration: Longest segment [steps]. By default every segment is longer with a probability of at
            most 1e-8.
        options: Options of `distribution.fit`, such as {"pseudocount": 1.0} of a histogram or {"shape": 1.0}
            of a negative binomial.
    """

    distribution: type[DurationDistribution] = Gaussian
    censoring: Censoring = Censoring.RIGHT
    max_duration: int | None = None
    options: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if not _is_distribution(self.distribution):
            raise InvalidInput(
                f"distribution is {self.distribution!r}, expected a class such as pf.durations.LogNormal"
            )
        require_type(self.censoring, "censoring", Censoring, 'pf.models.Censoring("both") makes one')
        validate_max_duration(self.max_duration)
        for name, value in self.options.items():
            if name not in self.distribution.options:
                known = ", ".join(self.distribution.options) or "no option"
                raise InvalidInput(f"options has {name!r}, but {self.distribution.name} has {known}")
            require_number(value, name, *self.distribution.options[name])

    @property
    def fixed_parameters(self) -> int:
        """Return how many parameters of each state the options fix."""
        return int("shape" in self.options)

    def fit(
        self, segments: Segments, previous: DurationDistribution | None, min_variance: float
    ) -> DurationDistribution:
        """Estimate the duration distribution from expected segments (M-step).

        Args:
            segments: Expected segments.
            previous: Distribution of the previous iteration.
            min_variance: Lower bound of the variance [steps^2].

        Returns:
            A distribution of the chosen class.
        """
        fit: Callable[..., DurationDistribution] = self.distribution.fit
        return fit(segments, previous, min_variance, **self.options)


def _is_distribution(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, DurationDistribution)


def validate_max_duration(max_duration: int | None) -> None:
    """Raise InvalidInput unless max_duration is None or a number of steps."""
    if max_duration is not None:
        require_count(max_duration, "max_duration", MAX_DURATION, 1)
