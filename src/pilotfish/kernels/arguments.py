"""What the kernels are given, where it takes several arrays to say one thing."""

from dataclasses import dataclass

from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class Emissions:
    """Gaussians of K states in each of P frames.

    whiteners[p, k] = W is the inverse of the lower Cholesky factor of Sigma[p, k], so that Sigma^-1 = W^T W;
    only its lower triangle is read. turns holds the first column of each unit quaternion that is a point of
    S^3: its deviations have three columns for its four, so E = D - len(turns).
    """

    means: Float[Array, "P K D"]
    precision_cholesky: Float[Array, "P K E E"]
    orientation_starts: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovTables:
    """A semi-Markov chain as its kernels read it: probabilities, and logarithms of how long visits last.

    transitions has a zero diagonal; a row of zeros is a state that is never left.
    log_visits[c, s - 1, k] is the log weight of a visit to k of which s steps were recorded:
    c = 0 with both ends inside the recording, 1 it began with the recording, 2 the recording ended it,
    3 it fills the recording. log_beyond[0] continues kind 2 and log_beyond[1] kind 3 to any s > S; kinds 0
    and 1 never last longer than S.
    """

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    log_segment_weights: Float[Array, "4 S K"]
    log_tail_weights: Float[Array, "2 K"]
