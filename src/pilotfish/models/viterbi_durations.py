"""From a hidden Markov model to a semi-Markov one: durations counted along Viterbi paths."""

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.models.durations import Gaussian
from pilotfish.models.em import expected_statistics
from pilotfish.models.semi_markov import SemiMarkovChain
from pilotfish.models.sequences import log_emissions, state_segments
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.types import Array, Int

ROUNDING_VARIANCE = 1.0 / 12.0  # steps^2, of a number rounded to a whole one
RELATIVE_DEVIATION = 0.1  # of the mean duration: the default regularisation


def count_durations(
    model: HiddenModel | Skill, data: Views, min_variance: float | None = None, *, complete: bool = False
) -> SemiMarkovChain:
    """Convert a fitted Markov model to a semi-Markov chain with Gaussian durations.

    Durations are mean and standard deviation of the segments of the Viterbi paths. The last segment of a
    demonstration counts as uncensored, which is a known bias. A state without segments gets the mean duration
    of its self-transition. Transitions are the expected transitions between different states, renormalised; a
    state with less than half a departure in all demonstrations together is final.

    Args:
        model: A Markov model.
        data: Demonstrations as every frame sees them.
        min_variance: Added to the variance of the durations [steps^2]; None adds a tenth of the mean,
            squared, and the variance of a duration rounded to steps.
        complete: Whether every demonstration ends in the last state.

    Returns:
        The chain.

    Source:
        Tanwani 2018, sections 3.2.1-3.2.2, equation 3.29 without the self-transitions in its denominator.
    """
    initial, transitions = model.dynamics.step_probabilities()
    segment_states, lengths = _viterbi_segments(model, data, complete)
    geometric = 1.0 / np.maximum(1.0 - np.diag(transitions), 1.0 / len(data.x[0]))
    means, variances = geometric.copy(), geometric**2
    for k in range(len(initial)):
        if len(state_lengths := lengths[segment_states == k]):
            means[k], variances[k] = state_lengths.mean(), state_lengths.var()
    exits = expected_statistics(model, data, complete=complete).transitions * (1.0 - np.eye(len(initial)))
    departures = exits.sum(axis=1, keepdims=True)
    next_probs = np.divide(exits, departures, out=np.zeros_like(exits), where=departures >= 0.5)
    added = (RELATIVE_DEVIATION * means) ** 2 + ROUNDING_VARIANCE if min_variance is None else min_variance
    return SemiMarkovChain(initial, next_probs, Gaussian(means, np.sqrt(variances + added)))


def _viterbi_segments(
    model: HiddenModel | Skill, data: Views, complete: bool
) -> tuple[Int[Array, " R"], Int[Array, " R"]]:
    parts = np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])
    if complete:
        for part in parts:
            part[-1, :-1] = -np.inf
    paths = [state_segments(model.dynamics.viterbi(np.ascontiguousarray(part))) for part in parts]
    return np.concatenate([path[0] for path in paths]), np.concatenate([path[1] for path in paths])
