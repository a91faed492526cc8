"""Inference along a Markov chain, in logarithms throughout, so that no path is lost to underflow.

Rounding. Log-probabilities of a recording reach 1e20 in magnitude if states are narrow or a step is far from
all of them, while those of the likely paths differ by a few nats. Smoothed probabilities are therefore
computed from emissions relative to those of the most probable path: at its nodes and those close to it,
numbers are small.
"""

from collections.abc import Callable

import numpy as np

from pilotfish.kernels.results import ForwardBackward, ViterbiPath
from pilotfish.types import Array, Float


def log_probability_array(probability: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Return the logarithm of probabilities, -inf where they are zero.

    Args:
        probability: Probabilities.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # NaN for negative values is rejected later
        logarithm: Float[Array, "*shape"] = np.log(probability)
    return logarithm


def subtract_step_maximum(log_emissions: Float[Array, "T K"]) -> tuple[Float[Array, "T K"], float]:
    """Return emissions relative to the largest of each step, and the sum of the subtracted numbers."""
    best = log_emissions.max(axis=1)
    best = np.where(best == -np.inf, 0.0, best)
    return log_emissions - best[:, None], float(best.sum())


def subtract_best_path(
    log_emissions: Float[Array, "T K"], find_path: Callable[[Float[Array, "T K"]], ViterbiPath]
) -> tuple[Float[Array, "T K"], float]:
    """Return emissions relative to those of the most probable path, and the sum of the subtracted numbers.

    The path is computed twice. If log-probabilities are large, rounding may hide which of two paths is more
    probable; the second search compares them relative to the first path.

    Args:
        log_emissions: log b_k(x_t); -inf is allowed.
        find_path: Viterbi algorithm of the chain, from emissions to a path.

    Returns:
        The relative emissions and the sum of the log-emissions of the path. If no path has a positive
        probability, emissions are relative to the largest of each step.
    """
    relative, log_offset = subtract_step_maximum(log_emissions)
    for _ in range(2):
        states, log_probability = find_path(relative)
        if log_probability == -np.inf:
            return relative, log_offset
        best = log_emissions[np.arange(len(log_emissions)), states]
        relative, log_offset = log_emissions - best[:, None], float(best.sum())
    return relative, log_offset


def log_forward_variables(
    log_emissions: Float[Array, "T K"], log_initial: Float[Array, " K"], log_transitions: Float[Array, "K K"]
) -> Float[Array, "T K"]:
    """Return alpha_t(k) = log p(x_1 .. x_t, state k at t).

    Source:
        Rabiner 1989, eqs. 19-20.
    """
    forward = np.empty_like(log_emissions)
    forward[0] = log_initial + log_emissions[0]
    for t in range(1, len(forward)):
        predicted = np.logaddexp.reduce(forward[t - 1][:, None] + log_transitions, axis=0)  # over j, (K,)
        forward[t] = predicted + log_emissions[t]
    return forward


def log_backward_variables(
    log_emissions: Float[Array, "T K"], log_transitions: Float[Array, "K K"]
) -> Float[Array, "T K"]:
    """Return beta_t(k) = log p(x_t+1 .. x_T | state k at t).

    Source:
        Rabiner 1989, eqs. 24-25.
    """
    backward = np.zeros_like(log_emissions)
    for t in range(len(backward) - 2, -1, -1):
        after = log_emissions[t + 1] + backward[t + 1]  # (K,)
        backward[t] = np.logaddexp.reduce(log_transitions + after, axis=1)  # over k
    return backward


def expected_transitions(
    forward: Float[Array, "T K"],
    log_transitions: Float[Array, "K K"],
    after: Float[Array, "T K"],
    log_evidence: Float[Array, " T"],
) -> Float[Array, "K K"]:
    """Return the sum over t of zeta_t(j, k) = p(state j at t, state k at t + 1 | all steps).

    Source:
        Rabiner 1989, eq. 37.
    """
    transition_counts = np.empty_like(log_transitions)
    for j, row in enumerate(log_transitions):
        log_zeta = forward[:-1, j, None] + row + after[1:] - log_evidence[:-1, None]  # (T - 1, K)
        transition_counts[j] = np.exp(log_zeta).sum(axis=0)
    return transition_counts


def forward_backward(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ForwardBackward:
    """Return smoothed state probabilities and expected transitions of one demonstration (forward-backward).

    Args:
        log_emissions: log b_k(x_t); -inf is allowed, and any range of magnitudes.
        initial: Initial probabilities; zeros are allowed.
        transitions: [j, k] = p(next state k | state j); zeros are allowed.

    Source:
        Rabiner 1989; Tanwani 2018, eqs. 3.8-3.13. Changed: every step is normalised by its own evidence,
        which equals the likelihood up to rounding, so that probabilities sum to one in long demonstrations.
    """
    log_initial, log_transitions = log_probability_array(initial), log_probability_array(transitions)
    log_forward = log_forward_variables(log_emissions, log_initial, log_transitions)
    relative, log_offset = subtract_best_path(
        log_emissions, lambda rows: best_path(rows, log_initial, log_transitions)
    )
    forward = log_forward_variables(relative, log_initial, log_transitions)
    log_likelihood = float(np.logaddexp.reduce(forward[-1])) + log_offset
    if log_likelihood == -np.inf:
        return ForwardBackward(-np.inf, np.zeros_like(forward), np.zeros_like(log_transitions), log_forward)
    backward = log_backward_variables(relative, log_transitions)
    joint = forward + backward  # log p(x, state k at t)
    log_evidence = np.logaddexp.reduce(joint, axis=1)  # (T,), all equal to log_likelihood
    smoothed_state_probs = np.exp(joint - log_evidence[:, None])
    transition_counts = expected_transitions(forward, log_transitions, relative + backward, log_evidence)
    return ForwardBackward(log_likelihood, smoothed_state_probs, transition_counts, log_forward)


def viterbi(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ViterbiPath:
    """Return the most probable path; among equally probable ones, the last step has the lower state index.

    Args:
        log_emissions: log b_k(x_t); -inf is allowed.
        initial: Initial probabilities.
        transitions: [j, k] = p(next state k | state j).

    Source:
        Viterbi 1967; Rabiner 1989, eqs. 32-35.
    """
    log_initial, log_transitions = log_probability_array(initial), log_probability_array(transitions)
    relative, log_offset = subtract_best_path(
        log_emissions, lambda rows: best_path(rows, log_initial, log_transitions)
    )
    states, log_probability = best_path(relative, log_initial, log_transitions)
    return states, log_probability + log_offset


def best_path(
    log_emissions: Float[Array, "T K"], log_initial: Float[Array, " K"], log_transitions: Float[Array, "K K"]
) -> ViterbiPath:
    """Return the result of one Viterbi recursion."""
    T, K = log_emissions.shape
    best = log_initial + log_emissions[0]
    origins = np.zeros((T, K), dtype=np.int64)  # most probable previous state
    for t in range(1, T):
        scores = best[:, None] + log_transitions  # [j, k]
        origins[t] = scores.argmax(axis=0)  # the first of equal scores
        best = scores.max(axis=0) + log_emissions[t]
    states = np.empty(T, dtype=np.int64)
    states[-1] = best.argmax()
    for t in range(T - 1, 0, -1):
        states[t - 1] = origins[t, states[t]]
    return states, float(best.max())
