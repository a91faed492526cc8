"""Expected segments of states: the sufficient statistics of duration distributions.

A segment is a maximal run of one state. A recording shows its length only if it begins and ends inside the
recording. With duration distribution p and survival function S(s) = p(s) + p(s + 1) + ..., a segment of s
recorded steps contributes to the likelihood

    uncensored        p(s)
    right-censored    S(s)                         the recording ends inside the segment
    left-censored     S(s) / mean                  the recording begins inside the segment, at a random step
    doubly censored   (S(s) + S(s + 1) + ...) / mean

The last two follow from length-biased sampling: a random step lies in a segment of length d with probability
d p(d) / mean, and at each of its d steps with equal probability.
"""

from dataclasses import dataclass, fields

import numpy as np

from pilotfish.types import Array, Bool, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Expected number of segments by recorded length s = 1 .. S and state. The sum of two is exact.

    Attributes:
        uncensored: Segments whose both ends are inside the recording.
        right_censored: Segments cut off by the end of the recording.
        left_censored: Segments cut off by the beginning of the recording.
        doubly_censored: Segments cut off at both ends.
    """

    uncensored: Float[Array, "S K"]
    right_censored: Float[Array, "S K"]
    left_censored: Float[Array, "S K"]
    doubly_censored: Float[Array, "S K"]

    def __add__(self, other: "Segments") -> "Segments":
        max_duration = max(len(self.uncensored), len(other.uncensored))
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return Segments(
            *(_pad_durations(a, max_duration) + _pad_durations(b, max_duration) for a, b in pairs)
        )

    @classmethod
    def all_uncensored(cls, counts: Float[Array, "S K"]) -> "Segments":
        """Return segments whose both ends are inside the recording.

        Args:
            counts: Expected number of segments by length and state.
        """
        zeros = np.zeros_like(counts)
        return cls(counts, zeros, zeros, zeros)

    def select_states(self, selected: Bool[Array, " K"]) -> "Segments":
        """Return the segments of the selected states.

        Args:
            selected: Whether each state is kept.
        """
        return Segments(*(getattr(self, f.name)[:, selected] for f in fields(self)))

    def recorded_length_moments(self) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
        """Return mean and variance of the recorded lengths, censored or not.

        A state without segments gets the moments of all states together.
        """
        counts = self.uncensored + self.right_censored + self.left_censored + self.doubly_censored
        pooled = counts.sum(axis=1, keepdims=True)
        if not pooled.any():
            pooled = np.ones_like(pooled)
        counts = np.where(counts.sum(axis=0) > 0.0, counts, pooled)
        p = counts / counts.sum(axis=0)
        steps = np.arange(1.0, len(p) + 1)
        means = steps @ p
        return means, (np.square(steps[:, None] - means) * p).sum(axis=0)


def _pad_durations(counts: Float[Array, "S K"], max_duration: int) -> Float[Array, "L K"]:
    return np.pad(counts, ((0, max_duration - len(counts)), (0, 0)))
