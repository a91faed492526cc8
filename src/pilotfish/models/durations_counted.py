"""From a Markov model to a semi-Markov one: durations counted along the most likely state sequences."""

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Views
from pilotfish.models.durations import GaussianDurations
from pilotfish.models.dynamics import SemiMarkovChain
from pilotfish.models.sequences import log_emissions
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import one_step_chain, statistics
from pilotfish.types import Array, Float, Int


def runs(states: Int[Array, " T"]) -> tuple[Int[Array, " R"], Int[Array, " R"]]:
    """The visits of a state sequence in order: which state, and for how many steps."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(states)) + 1])
    return states[begins], np.diff(np.append(begins, len(states)))


def with_durations(model: HiddenModel | Skill, data: Views, floor: float) -> SemiMarkovChain:
    """The thesis' semi-Markov reading of a fitted Markov model, demonstration by demonstration.

    Durations are the mean and deviation of the runs of the Viterbi sequence; floor [steps^2] is added to
    their variance. The last run of a demonstration is counted as if it ended there, a known bias. A state
    that the sequences never visit gets the mean duration of its self-transition.
    Transitions are the expected counts between different states, renormalised; a state that all
    demonstrations together leave less than half a time is final.
    Source: Tanwani 2018, sections 3.2.1-3.2.2, equation 3.29 without the self-transitions in its denominator.
    """
    initial, transitions = one_step_chain(model.dynamics)
    visited, lengths = _visits(model, data)
    K = len(initial)
    geometric = 1.0 / np.maximum(1.0 - np.diag(transitions), 1.0 / len(data.x[0]))
    means, variances = geometric.copy(), geometric**2
    for k in range(K):
        if len(own := lengths[visited == k]):
            means[k], variances[k] = own.mean(), own.var()
    return SemiMarkovChain(
        initial,
        _between(statistics(model, data).transitions),
        GaussianDurations(means, np.sqrt(variances + floor)),
    )


def _visits(model: HiddenModel | Skill, data: Views) -> tuple[Int[Array, " R"], Int[Array, " R"]]:
    initial, transitions = one_step_chain(model.dynamics)
    parts = np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])
    paths = [runs(kernels.viterbi(np.ascontiguousarray(part), initial, transitions).states) for part in parts]
    return np.concatenate([p[0] for p in paths]), np.concatenate([p[1] for p in paths])


def _between(counts: Float[Array, "K K"]) -> Float[Array, "K K"]:
    leaving = counts * (1.0 - np.eye(len(counts)))
    departures = leaving.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(leaving, departures, out=np.zeros_like(leaving), where=departures >= 0.5))
