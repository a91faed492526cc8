"""Expected sufficient statistics of a skill: all that the M-step needs to know of the data."""

from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments, TangentMoments
from pilotfish.models.durations import Segments
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import shorten_repr

BLOCK_ROWS = 8192  # rows that are summed at a time


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """Expected statistics of demonstrations under a model of K states. The sum of two is exact.

    Attributes:
        moments: Counts, means and scatter matrices of the states, for each frame.
        initial_counts: Expected number of demonstrations that begin in each state.
        transitions: Expected number of steps from one state to another; of a semi-Markov model, of segments
            of one state that follow a segment of another.
        log_likelihood: Log-likelihood of the demonstrations [nats].
        segments: Expected number of segments by length; semi-Markov models only.
    """

    moments: tuple[Moments | TangentMoments, ...]
    initial_counts: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    log_likelihood: float
    segments: Segments | None = None

    def __add__(self, other: "Statistics") -> "Statistics":
        return Statistics(
            tuple(_add_moments(a, b) for a, b in zip(self.moments, other.moments, strict=True)),
            self.initial_counts + other.initial_counts,
            self.transitions + other.transitions,
            self.log_likelihood + other.log_likelihood,
            self.segments + other.segments if self.segments and other.segments else None,
        )

    def drop_states(self, dropped: Bool[Array, " K"]) -> "Statistics":
        """Return the statistics of the remaining states.

        Steps through a dropped state lead to its successors, in proportion to their counts.

        Args:
            dropped: Whether each state is dropped.
        """
        transitions = self.transitions.copy()
        for k in np.flatnonzero(dropped):
            next_probs = np.delete(transitions[k], k)
            if next_probs.sum() > 0.0:
                others = np.delete(np.arange(len(transitions)), k)
                transitions[np.ix_(others, others)] += np.outer(
                    transitions[others, k], next_probs / next_probs.sum()
                )
            transitions[k], transitions[:, k] = 0.0, 0.0
        kept = ~dropped
        segments = self.segments.select_states(kept) if self.segments else None
        if segments:
            np.fill_diagonal(transitions, 0.0)  # segments of one state with the dropped state between them
        return Statistics(
            tuple(m[kept] for m in self.moments),
            self.initial_counts[kept],
            transitions[np.ix_(kept, kept)],
            self.log_likelihood,
            segments,
        )


def _add_moments(a: Moments | TangentMoments, b: Moments | TangentMoments) -> Moments | TangentMoments:
    if isinstance(a, Moments) and isinstance(b, Moments):
        return a + b
    if isinstance(a, TangentMoments) and isinstance(b, TangentMoments):
        return a + b
    raise InvalidInput(
        "statistics of skills with and without orientations on S^3 were added, expected one kind; add those "
        "of demonstrations with the same layout"
    )


def labelled_statistics(views: Views, labels: Int[Array, " N"], states: int) -> Statistics:
    """Compute the statistics of data whose states are known.

    Args:
        views: Demonstrations as every frame sees them.
        labels: State of every datapoint, from 0 to states - 1.
        states: Number of states.

    Returns:
        The statistics; their log-likelihood is NaN.
    """
    ends = np.cumsum(views.lengths)
    within_demonstration = np.ones(len(labels) - 1, dtype=bool)
    within_demonstration[ends[:-1] - 1] = False  # no transition from one demonstration to the next
    transition_counts = np.zeros((states, states))
    np.add.at(transition_counts, (labels[:-1][within_demonstration], labels[1:][within_demonstration]), 1.0)
    initial_counts = np.bincount(labels[ends - views.lengths], minlength=states).astype(float)
    frame_moments = tuple(
        TangentMoments.from_data(x, np.eye(states)[labels], views.orientation_starts)
        if views.orientation_starts
        else _labelled_moments(x, labels, states)
        for x in views.x
    )
    return Statistics(frame_moments, initial_counts, transition_counts, np.nan)


def _labelled_moments(x: Float[Array, "N D"], labels: Int[Array, " N"], states: int) -> Moments:
    """Sum blocks of rows, so that little memory is needed beside the data."""
    moments_by_state = [_moments_of_rows(x, np.flatnonzero(labels == k)) for k in range(states)]
    return Moments(
        np.concatenate([m.counts for m in moments_by_state]),
        np.concatenate([m.means for m in moments_by_state]),
        np.concatenate([m.scatter_matrices for m in moments_by_state]),
    )


def _moments_of_rows(x: Float[Array, "N D"], rows: Int[Array, " n"]) -> Moments:
    blocks = (rows[start : start + BLOCK_ROWS] for start in range(0, max(len(rows), 1), BLOCK_ROWS))
    return reduce(add, (Moments.from_data(x[block], np.ones((len(block), 1))) for block in blocks))
