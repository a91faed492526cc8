"""Arguments of the kernels that consist of several arrays."""

from dataclasses import dataclass

from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Emissions:
    """Gaussian emissions of K states in each of P frames.

    Attributes:
        means: Mean of each state in each frame.
        precision_cholesky: Lower triangular W = inverse of the lower Cholesky factor of Sigma, so that
            W^T W = Sigma^-1. Entries above the diagonal are not read.
        orientation_starts: First column of each unit quaternion, which is a point of S^3. Its deviations have
            three columns instead of four, so that E = D - len(orientation_starts).
    """

    means: Float[Array, "P K D"]
    precision_cholesky: Float[Array, "P K E E"]
    orientation_starts: tuple[int, ...] = ()


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovTables:
    """Semi-Markov chain: probabilities, and log-weights of segment durations.

    A segment is a maximal run of steps in one state. Its kind c is 0 if both ends are inside the recording,
    1 if it begins with the recording (left-censored), 2 if it ends with the recording (right-censored), and 3
    if it fills the recording. Kinds 0 and 1 last at most S steps.

    Attributes:
        initial: Probability of each state at the first step.
        transitions: Transition probabilities with a zero diagonal; a final state has a row of zeros.
        log_segment_weights: Log-weight [c, s - 1, k] of a segment of kind c in state k with s recorded steps.
        log_tail_weights: Log-weights of the segments of kinds 2 and 3 with more than S recorded steps.
    """

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    log_segment_weights: Float[Array, "4 S K"]
    log_tail_weights: Float[Array, "2 K"]
