"""From a hidden Markov model to a semi-Markov one: durations counted along Viterbi paths."""

from functools import partial

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.models.durations import Gaussian
from pilotfish.models.em import expected_statistics
from pilotfish.models.partitions import Partitions, as_partitions
from pilotfish.models.semi_markov import SemiMarkovChain
from pilotfish.models.sequences import log_emissions, state_segments
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.types import Array, Int

ROUNDING_VARIANCE = 1.0 / 12.0  # steps^2, of a number rounded to a whole one
RELATIVE_DEVIATION = 0.1  # of the mean duration: the default regularisation


def count_durations(
    model: HiddenModel | Skill,
    data: Views | Partitions[Views],
    min_variance: float | None = None,
    *,
    complete: bool = False,
) -> SemiMarkovChain:
    """Convert a fitted Markov model to a semi-Markov chain with Gaussian durations.

    Durations are mean and standard deviation of the segments of the Viterbi paths. The last segment of a
    demonstration counts as uncensored, which is a known bias. A state without segments gets the mean duration
    of its self-transition. Transitions are the expected transitions between different states, renormalised; a
    state with less than half a departure in all demonstrations together is final.

    Args:
        model: A Markov model.
        data: Demonstrations as every frame sees them, in parts or together.
        min_variance: Added to the variance of the durations [steps^2]; None adds a tenth of the mean,
            squared, and the variance of a duration rounded to steps.
        complete: Whether every demonstration ends in the last state.

    Returns:
        The chain.

    Source:
        Tanwani 2018, sections 3.2.1-3.2.2, equation 3.29 without the self-transitions in its denominator.
    """
    initial, transitions = model.dynamics.step_probabilities()
    counts: Int[Array, "S K"] = np.zeros((1, len(initial)), dtype=np.int64)
    for part in as_partitions(data).map(partial(_count_segments, model=model, complete=complete)):
        counts = _pad(counts, len(part)) + _pad(part, len(counts))
    lengths = np.arange(len(counts), dtype=float)
    rows = float(lengths @ counts.sum(axis=1))
    geometric = 1.0 / np.maximum(1.0 - np.diag(transitions), 1.0 / rows)
    means, variances = geometric.copy(), geometric**2
    for k in np.flatnonzero(counts.any(axis=0)):
        means[k] = np.average(lengths, weights=counts[:, k])
        variances[k] = np.average((lengths - means[k]) ** 2, weights=counts[:, k])
    exits = expected_statistics(model, data, complete=complete).transitions * (1.0 - np.eye(len(initial)))
    departures = exits.sum(axis=1, keepdims=True)
    next_probs = np.divide(exits, departures, out=np.zeros_like(exits), where=departures >= 0.5)
    added = (RELATIVE_DEVIATION * means) ** 2 + ROUNDING_VARIANCE if min_variance is None else min_variance
    return SemiMarkovChain(initial, next_probs, Gaussian(means, np.sqrt(variances + added)))


def _count_segments(data: Views, model: HiddenModel | Skill, complete: bool) -> Int[Array, "S K"]:
    """Return the number of segments of each length, from 0, and state on the Viterbi paths."""
    counts = np.zeros((int(data.lengths.max()) + 1, model.means.shape[1]), dtype=np.int64)
    for log_b in np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1]):
        if complete:
            log_b[-1, :-1] = -np.inf
        states, lengths = state_segments(model.dynamics.viterbi(np.ascontiguousarray(log_b)))
        np.add.at(counts, (lengths, states), 1)
    return counts


def _pad(counts: Int[Array, "S K"], rows: int) -> Int[Array, "R K"]:
    return np.pad(counts, ((0, max(0, rows - len(counts))), (0, 0)))
