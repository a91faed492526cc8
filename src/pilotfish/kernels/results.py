"""Results of the kernels."""

from typing import NamedTuple

from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

# Filtered inference along a semi-Markov chain, as if the recording ended at each step. First,
# [t, k] = log p(steps 0 to t, a segment of k ends with step t, another may follow). Second,
# [t, k] = log p(steps 0 to t, state k at t).
SemiMarkovForward = tuple[Float[Array, "T K"], Float[Array, "T K"]]

# Most probable path: the state at each step, and log p(all steps, this path), -inf if no path explains them.
# Among equally probable paths, it is the one whose last differing state has the lower index.
ViterbiPath = tuple[Int[Array, " T"], float]

# Optimal feedback u_t = feedforwards[t] - gains[t] e_t with e_t = x_t - targets[t], for N = T - 1 steps: the
# gains, the feedforwards, and P and d of the cost from step t on, e^T P e + 2 d^T e + constant.
RiccatiSolution = tuple[
    Float[Array, "N m n"], Float[Array, "N m"], Float[Array, "T n n"], Float[Array, "T n"]
]


@shorten_repr
class ForwardBackward(NamedTuple):
    """Smoothed inference along a Markov chain.

    If no path has a positive probability, log_likelihood is -inf, and probabilities and counts are zero.

    Attributes:
        log_likelihood: log p(all steps).
        smoothed_state_probs: [t, k] = p(state k at t | all steps), gamma.
        transition_counts: [j, k] = expected number of steps from j to k, the sum of zeta over time.
        log_forward: [t, k] = log p(steps 0 to t, state k at t).
    """

    log_likelihood: float
    smoothed_state_probs: Float[Array, "T K"]
    transition_counts: Float[Array, "K K"]
    log_forward: Float[Array, "T K"]


@shorten_repr
class SemiMarkovForwardBackward(NamedTuple):
    """Smoothed inference along a semi-Markov chain.

    If no path has a positive probability, log_likelihood is -inf, and probabilities and counts are zero.

    Attributes:
        log_likelihood: log p(all steps).
        smoothed_state_probs: [t, k] = p(state k at t | all steps).
        transition_counts: [j, k] = expected number of segments in k right after one in j.
        segment_counts: [c, s - 1, k] = expected number of segments of kind c in k with s recorded steps;
            kinds as in SemiMarkovTables.
        long_segment_counts: Expected number of segments of kinds 2 and 3 with more than S recorded steps.
    """

    log_likelihood: float
    smoothed_state_probs: Float[Array, "T K"]
    transition_counts: Float[Array, "K K"]
    segment_counts: Float[Array, "4 S K"]
    long_segment_counts: Float[Array, "2 K"]


@shorten_repr
class EStep(NamedTuple):
    """Expected sufficient statistics of a hidden Markov or semi-Markov model over M demonstrations.

    A demonstration that no path explains has log-likelihood -inf and adds nothing to the sums. In the sums,
    gamma is the smoothed state probability and e the deviation from the given mean.

    Attributes:
        log_likelihoods: Log-likelihood of each demonstration.
        counts: Sum of gamma over all steps, N_k.
        initial_counts: Sum of gamma over the first steps.
        transition_counts: Expected number of transitions.
        segment_counts: Expected numbers of segments, as in SemiMarkovForwardBackward; S = 0 for a Markov
            model.
        long_segment_counts: Expected numbers of longer segments; zero for a Markov model.
        deviation_sums: Sum of gamma e.
        scatter_matrices: Sum of gamma e e^T.
    """

    log_likelihoods: Float[Array, " M"]
    counts: Float[Array, " K"]
    initial_counts: Float[Array, " K"]
    transition_counts: Float[Array, "K K"]
    segment_counts: Float[Array, "4 S K"]
    long_segment_counts: Float[Array, "2 K"]
    deviation_sums: Float[Array, "P K E"]
    scatter_matrices: Float[Array, "P K E E"]


@shorten_repr
class RiemannianProduct(NamedTuple):
    """Products of Gaussians on R^n x S^3 x ..., one for each state.

    Attributes:
        means: Modes of the products.
        covariances: Covariances in their tangent spaces.
    """

    means: Float[Array, "K D"]
    covariances: Float[Array, "K E E"]
