"""E-steps of task-parameterised hidden Markov and semi-Markov models (TP-HMM, TP-HSMM)."""

import numpy as np

from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.reference.emission import log_emissions
from pilotfish.kernels.reference.manifold import deviations
from pilotfish.kernels.reference.markov import forward_backward, log_probability_array
from pilotfish.kernels.reference.semi_markov import semi_markov_forward_backward
from pilotfish.kernels.results import EStep
from pilotfish.types import Array, Float, Int


def e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    initial: Float[Array, " K"],
    transitions: Float[Array, "K K"],
    emissions: Emissions,
    threads: int = 1,
    final: Float[Array, " K"] | None = None,
) -> EStep:
    """Return the expected sufficient statistics of M demonstrations under a hidden Markov model.

    Moments are about the given means, which are close to the new ones, so that shifting them does not cancel.

    Args:
        x: Demonstrations one after the other, in every frame.
        lengths: Number of steps of each demonstration, of sum N.
        initial: Initial probabilities.
        transitions: Transition probabilities.
        emissions: Gaussians in every frame.
        threads: Largest number of threads of the compiled kernel, 0 for all cores; the sums do not depend on
            it.
        final: Probability of a demonstration to end at its last step, given the state there; None is 1. A
            state with 0 is not the last one of any demonstration.

    Source:
        Rabiner 1989; Tanwani 2018, eqs. 3.8-3.17, 3.22-3.25.
    """
    K, log_likelihoods, smoothed_state_probs = len(initial), [], []
    initial_counts, transition_counts = np.zeros(K), np.zeros((K, K))
    for part in np.split(x, np.cumsum(lengths)[:-1], axis=1):
        log_b = log_emissions(part, emissions)
        if final is not None:
            log_b[-1] += log_probability_array(final)
        chain = forward_backward(log_b, initial, transitions)
        log_likelihoods.append(chain.log_likelihood)
        smoothed_state_probs.append(chain.smoothed_state_probs)
        initial_counts += chain.smoothed_state_probs[0]
        transition_counts += chain.transition_counts
    gamma = np.concatenate(smoothed_state_probs)  # (N, K)
    deviation_sums, scatter_matrices = deviation_moments(x, gamma, emissions)
    return EStep(
        np.array(log_likelihoods),
        gamma.sum(axis=0),
        initial_counts,
        transition_counts,
        np.zeros((4, 0, K)),
        np.zeros((2, K)),
        deviation_sums,
        scatter_matrices,
    )


def semi_markov_e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    tables: SemiMarkovTables,
    emissions: Emissions,
    threads: int = 1,
) -> EStep:
    """Return the expected sufficient statistics of M demonstrations under a hidden semi-Markov model.

    Args:
        x: Demonstrations one after the other, in every frame.
        lengths: Number of steps of each demonstration, of sum N.
        tables: Semi-Markov chain.
        emissions: Gaussians in every frame.
        threads: Largest number of threads of the compiled kernel, 0 for all cores; the sums do not depend on
            it.
    """
    parts = np.split(x, np.cumsum(lengths)[:-1], axis=1)
    chains = [semi_markov_forward_backward(log_emissions(part, emissions), tables) for part in parts]
    gamma = np.concatenate([chain.smoothed_state_probs for chain in chains])  # (N, K)
    return EStep(
        np.array([chain.log_likelihood for chain in chains]),
        gamma.sum(axis=0),
        np.sum([chain.smoothed_state_probs[0] for chain in chains], axis=0),
        np.sum([chain.transition_counts for chain in chains], axis=0),
        np.sum([chain.segment_counts for chain in chains], axis=0),
        np.sum([chain.long_segment_counts for chain in chains], axis=0),
        *deviation_moments(x, gamma, emissions),
    )


def deviation_moments(
    x: Float[Array, "P N D"],
    gamma: Float[Array, "N K"],
    emissions: Emissions,
) -> tuple[Float[Array, "P K E"], Float[Array, "P K E E"]]:
    """Return the sums of gamma e and gamma e e^T, e = deviation from the mean, per frame and state."""
    P, K, E, _ = emissions.precision_cholesky.shape
    deviation_sums, scatter_matrices = np.empty((P, K, E)), np.empty((P, K, E, E))
    for p in range(P):
        for k in range(K):
            error = deviations(x[p], emissions.means[p, k], emissions.orientation_starts)  # (N, E)
            weighted = gamma[:, k, None] * error
            deviation_sums[p, k], scatter_matrices[p, k] = weighted.sum(axis=0), weighted.T @ error
    return deviation_sums, scatter_matrices
