"""The expectation step of a task-parameterised hidden Markov model."""

import numpy as np

from pilotfish.kernels.arguments import Emissions
from pilotfish.kernels.results import EStep
from pilotfish.kernels.twins.chain import forward_backward
from pilotfish.kernels.twins.emission import deviations, log_emissions
from pilotfish.types import Array, Float, Int


def e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    initial: Float[Array, " K"],
    transitions: Float[Array, "K K"],
    emissions: Emissions,
    threads: int = 1,
) -> EStep:
    """Expected sufficient statistics of M demonstrations laid end to end: N = lengths.sum().

    Moments are taken about the means given, close to the new ones: nothing cancels when they are shifted.
    threads bounds how many share the work of the compiled kernel; the sums do not depend on it.
    Source: Rabiner 1989; Tanwani 2018, eqs. 3.8-3.17, 3.22-3.25.
    """
    K, log_likelihoods, posteriors = len(initial), [], []
    first, counts = np.zeros(K), np.zeros((K, K))
    for part in np.split(x, np.cumsum(lengths)[:-1], axis=1):
        chain = forward_backward(log_emissions(part, emissions), initial, transitions)
        log_likelihoods.append(chain.log_likelihood)
        posteriors.append(chain.posteriors)
        first += chain.posteriors[0]
        counts += chain.transitions
    gamma = np.concatenate(posteriors)  # (N, K)
    offsets, scatters = moments(x, gamma, emissions)
    return EStep(np.array(log_likelihoods), gamma.sum(axis=0), first, counts, offsets, scatters)


def moments(
    x: Float[Array, "P N D"],
    gamma: Float[Array, "N K"],
    emissions: Emissions,
) -> tuple[Float[Array, "P K E"], Float[Array, "P K E E"]]:
    """Sum of gamma e and of gamma e e^T, e the deviation from the mean, for every frame and state."""
    P, K, E, _ = emissions.whiteners.shape
    offsets, scatters = np.empty((P, K, E)), np.empty((P, K, E, E))
    for p in range(P):
        for k in range(K):
            error = deviations(x[p], emissions.means[p, k], emissions.turns)  # (N, E)
            weighted = gamma[:, k, None] * error
            offsets[p, k], scatters[p, k] = weighted.sum(axis=0), weighted.T @ error
    return offsets, scatters
