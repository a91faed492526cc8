"""Inference along a Markov chain, in logarithms throughout: no path is ever lost to underflow."""

import numpy as np

from pilotfish.kernels.results import ForwardBackward, Viterbi
from pilotfish.types import Array, Float


def log_or_never(probability: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Logarithm of a probability, -inf where it is zero."""
    with np.errstate(divide="ignore"):
        logarithm: Float[Array, "*shape"] = np.log(probability)
    return logarithm


def log_forwards(
    log_emissions: Float[Array, "T K"], log_initial: Float[Array, " K"], log_transitions: Float[Array, "K K"]
) -> Float[Array, "T K"]:
    """alpha_t,k = log p(x_1 .. x_t, state k at t).    Source: Rabiner 1989, eqs. 19-20."""
    forward = np.empty_like(log_emissions)
    forward[0] = log_initial + log_emissions[0]
    for t in range(1, len(forward)):
        reached = np.logaddexp.reduce(
            forward[t - 1][:, None] + log_transitions, axis=0
        )  # over where from, (K,)
        forward[t] = reached + log_emissions[t]
    return forward


def log_backwards(
    log_emissions: Float[Array, "T K"], log_transitions: Float[Array, "K K"]
) -> Float[Array, "T K"]:
    """beta_t,k = log p(x_t+1 .. x_T | state k at t).    Source: Rabiner 1989, eqs. 24-25."""
    backward = np.zeros_like(log_emissions)
    for t in range(len(backward) - 2, -1, -1):
        after = log_emissions[t + 1] + backward[t + 1]  # (K,)
        backward[t] = np.logaddexp.reduce(log_transitions + after, axis=1)  # over where to
    return backward


def expected_transitions(
    forward: Float[Array, "T K"],
    log_transitions: Float[Array, "K K"],
    after: Float[Array, "T K"],
    log_evidence: Float[Array, " T"],
) -> Float[Array, "K K"]:
    """Sum over t of zeta_t,j,k = p(state j at t, k at t + 1 | all steps).    Source: Rabiner 1989, eq. 37."""
    counts = np.empty_like(log_transitions)
    for j, row in enumerate(log_transitions):
        log_zeta = forward[:-1, j, None] + row + after[1:] - log_evidence[:-1, None]  # (T - 1, K)
        counts[j] = np.exp(log_zeta).sum(axis=0)
    return counts


def forward_backward(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ForwardBackward:
    """Posteriors of the states of one demonstration; transitions[j, k] = p(k next | j now).

    Emissions may be -inf, and differ by any number of nats; probabilities may be zero.
    Source: Rabiner 1989; Tanwani 2018, eqs. 3.8-3.13. Ours: every step has its own evidence, equal to the
    likelihood but for rounding, so that posteriors sum to one however long the demonstration.
    """
    log_transitions = log_or_never(transitions)
    forward = log_forwards(log_emissions, log_or_never(initial), log_transitions)
    log_likelihood = float(np.logaddexp.reduce(forward[-1]))
    if log_likelihood == -np.inf:
        return ForwardBackward(-np.inf, np.zeros_like(forward), np.zeros_like(log_transitions), forward)
    backward = log_backwards(log_emissions, log_transitions)
    joint = forward + backward  # log p(x, state k at t)
    log_evidence = np.logaddexp.reduce(joint, axis=1)  # (T,), all equal to log_likelihood
    posteriors = np.exp(joint - log_evidence[:, None])
    counts = expected_transitions(forward, log_transitions, log_emissions + backward, log_evidence)
    return ForwardBackward(log_likelihood, posteriors, counts, forward)


def viterbi(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> Viterbi:
    """The most probable path; at a tie the lower state index, the last step decided first.

    Source: Viterbi 1967; Rabiner 1989, eqs. 32-35.
    """
    log_transitions = log_or_never(transitions)
    T, K = log_emissions.shape
    best = log_or_never(initial) + log_emissions[0]
    origins = np.zeros((T, K), dtype=np.int64)  # the best state just before
    for t in range(1, T):
        scores = best[:, None] + log_transitions  # from, to
        origins[t] = scores.argmax(axis=0)  # argmax takes the first of equals
        best = scores.max(axis=0) + log_emissions[t]
    states = np.empty(T, dtype=np.int64)
    states[-1] = best.argmax()
    for t in range(T - 1, 0, -1):
        states[t - 1] = origins[t, states[t]]
    return Viterbi(states, float(best.max()))
