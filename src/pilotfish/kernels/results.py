"""What the kernels give back: one frozen value for each."""

from dataclasses import dataclass

from pilotfish.types import Array, Float, Int


@dataclass(frozen=True, slots=True, eq=False)
class EStep:
    """What a hidden Markov model's posteriors add up to, over M demonstrations.

    gamma is the posterior of a state at a step, zeta of two states at two steps in a row. A demonstration
    that no path explains has log-likelihood -inf and adds nothing to the sums.
    """

    log_likelihoods: Float[Array, " M"]
    counts: Float[Array, " K"]  # sum of gamma
    initial_counts: Float[Array, " K"]  # sum over demonstrations of gamma at their first step
    transitions: Float[Array, "K K"]  # sum of zeta
    offsets: Float[Array, "P K E"]  # sum of gamma e, e the deviation from the mean given
    scatter_matrices: Float[Array, "P K E E"]  # sum of gamma e e^T


@dataclass(frozen=True, slots=True, eq=False)
class ForwardBackward:
    """Where a Markov chain was, given everything that it emitted.

    posteriors[t, k] = p(state k at t | all steps), transitions[j, k] = expected number of steps from j to k,
    log_forward[t, k] = log p(steps 0 to t, state k at t). At log_likelihood -inf the first two are zero.
    """

    log_likelihood: float
    smoothed_state_probs: Float[Array, "T K"]
    transitions: Float[Array, "K K"]
    log_forward: Float[Array, "T K"]


@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovForwardBackward:
    """Where a semi-Markov chain was, given everything that it emitted.

    posteriors[t, k] = p(state k at t | all steps), transitions[j, k] = expected number of visits to k right
    after one to j. visits[c, s - 1, k] = expected number of visits to k of s steps, of the four kinds c that
    SemiMarkovTables tells; beyond[0, k] and beyond[1, k] of last and of only visits longer than its S steps.
    At log_likelihood -inf all but it are zero.
    """

    log_likelihood: float
    smoothed_state_probs: Float[Array, "T K"]
    transitions: Float[Array, "K K"]
    segments: Float[Array, "4 S K"]
    tail_counts: Float[Array, "2 K"]


@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovForward:
    """Where a semi-Markov chain may be, given what it has emitted so far.

    log_ends[t, k] = log p(steps 0 to t, a visit to k ends with step t and another may follow),
    log_occupancy[t, k] = log p(steps 0 to t, state k at t).
    """

    log_segment_ends: Float[Array, "T K"]
    log_forward: Float[Array, "T K"]


@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovEStep:
    """What a hidden semi-Markov model's posteriors add up to, over M demonstrations; fields as in EStep and
    SemiMarkov. A demonstration that no path explains has log-likelihood -inf and adds nothing to the sums.
    """

    log_likelihoods: Float[Array, " M"]
    counts: Float[Array, " K"]
    initial_counts: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    segments: Float[Array, "4 S K"]
    tail_counts: Float[Array, "2 K"]
    offsets: Float[Array, "P K E"]
    scatter_matrices: Float[Array, "P K E E"]


@dataclass(frozen=True, slots=True, eq=False)
class ViterbiPath:
    """A most probable path; of equally probable ones, that whose last differing state has the lower index.

    log_probability = log p(all steps, this path). At -inf no path explains the steps: states mean nothing.
    """

    states: Int[Array, " T"]
    log_probability: float


@dataclass(frozen=True, slots=True, eq=False)
class RiccatiSolution:
    """The tracker of least cost: u_t = feedforwards[t] - gains[t] (x_t - targets[t]), for S = T - 1 steps.

    The cost still to pay at step t is e^T values[t] e + 2 gradients[t]^T e + constant, e = x_t - targets[t].
    """

    gains: Float[Array, "S m n"]
    feedforwards: Float[Array, "S m"]
    values: Float[Array, "T n n"]
    gradients: Float[Array, "T n"]
