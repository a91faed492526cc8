"""From a Markov model to a semi-Markov one: durations counted along the most likely state sequences."""

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Views
from pilotfish.models.durations.values import GaussianDurations
from pilotfish.models.dynamics import SemiMarkovChain
from pilotfish.models.sequences import log_emissions
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import expected_statistics, step_probabilities
from pilotfish.types import Array, Float, Int


def state_segments(states: Int[Array, " T"]) -> tuple[Int[Array, " R"], Int[Array, " R"]]:
    """The visits of a state sequence in order: which state, and for how many steps."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(states)) + 1])
    return states[starts], np.diff(np.append(starts, len(states)))


def count_durations(model: HiddenModel | Skill, data: Views, min_variance: float) -> SemiMarkovChain:
    """The thesis' semi-Markov reading of a fitted Markov model, demonstration by demonstration.

    Durations are the mean and deviation of the runs of the Viterbi sequence; floor [steps^2] is added to
    their variance. The last run of a demonstration is counted as if it ended there, a known bias. A state
    that the sequences never visit gets the mean duration of its self-transition.
    Transitions are the expected counts between different states, renormalised; a state that all
    demonstrations together leave less than half a time is final.
    Source: Tanwani 2018, sections 3.2.1-3.2.2, equation 3.29 without the self-transitions in its denominator.
    """
    initial, transitions = step_probabilities(model.dynamics)
    segment_states, lengths = _viterbi_segments(model, data)
    K = len(initial)
    geometric = 1.0 / np.maximum(1.0 - np.diag(transitions), 1.0 / len(data.x[0]))
    means, variances = geometric.copy(), geometric**2
    for k in range(K):
        if len(state_lengths := lengths[segment_states == k]):
            means[k], variances[k] = state_lengths.mean(), state_lengths.var()
    return SemiMarkovChain(
        initial,
        _transition_probs(expected_statistics(model, data).transitions),
        GaussianDurations(means, np.sqrt(variances + min_variance)),
    )


def _viterbi_segments(model: HiddenModel | Skill, data: Views) -> tuple[Int[Array, " R"], Int[Array, " R"]]:
    initial, transitions = step_probabilities(model.dynamics)
    parts = np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])
    paths = [
        state_segments(kernels.viterbi(np.ascontiguousarray(part), initial, transitions).states)
        for part in parts
    ]
    return np.concatenate([p[0] for p in paths]), np.concatenate([p[1] for p in paths])


def _transition_probs(counts: Float[Array, "K K"]) -> Float[Array, "K K"]:
    exits = counts * (1.0 - np.eye(len(counts)))
    departures = exits.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(exits, departures, out=np.zeros_like(exits), where=departures >= 0.5))
