"""Inference along a semi-Markov chain: the duration of a visit has a distribution of its own in each state.

A visit begins after the first b steps and takes s of them. In every function here starts[b, i] is the log
probability of the first b steps and that a visit to i begins after them, ends[t, i] of the first t steps and
that a visit to i ends with them and another one follows.

Log-probabilities of a recording reach 1e20 in magnitude where states are sharp, while those of the paths
that matter differ by a few nats. The posteriors are therefore computed from emissions relative to those of
the most probable path: at the nodes of that path and of those close to it, all numbers are small.
"""

import numpy as np

from pilotfish.kernels.arguments import SemiMarkovTables
from pilotfish.kernels.reference.markov import log_probability_array, subtract_best_path
from pilotfish.kernels.results import SemiMarkovForward, SemiMarkovForwardBackward, ViterbiPath
from pilotfish.types import Array, Float, Int


def semi_markov(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForwardBackward:
    """Posteriors of the states and visits of one demonstration.

    Emissions may be -inf, and differ by any number of nats; weights and probabilities may be zero. A visit
    that lasts until the recording ends is of kind 2 or 3, even if both end together.
    Cost: O(T K (K + S)).
    Source: Yu 2010, the explicit duration model; Guedon 2003 for a last visit that is cut short. Ours: the
    same for a first visit.
    """
    relative, log_offset = subtract_best_path(log_emissions, lambda rows: best_path(rows, tables))
    starts, ends = log_forward_variables(relative, tables)
    last = starts + log_last_segments(relative, tables)  # (T, K), log p(all steps, this is the last visit)
    log_likelihood = float(np.logaddexp.reduce(last, axis=None))
    if log_likelihood == -np.inf:
        return impossible_result(log_emissions, tables)
    after_starts, after_ends = log_backward_variables(relative, tables)
    segments, tail_counts = np.zeros_like(tables.log_segment_weights), np.zeros_like(tables.log_tail_weights)
    ending = np.zeros_like(ends)  # (T, K), expected number of visits that end with step t
    for b, final in enumerate(np.exp(last - log_likelihood)):
        steps = log_segments_from(b, relative, tables)  # (s, K), those that end before the recording
        until = slice(b + 1, b + 1 + len(steps))
        expected = np.exp(starts[b] + steps + after_ends[until] - log_likelihood)
        segments[int(b == 0), : len(steps)] += expected
        ending[until] += expected
        last_segment(segments[2:], tail_counts, len(ends) - b)[int(b == 0)] += final
    starting = np.exp(starts + after_starts - log_likelihood)
    changes = expected_transitions(ends, tables, after_starts - log_likelihood)
    return SemiMarkovForwardBackward(
        log_likelihood + log_offset, state_probabilities(starting, ending), changes, segments, tail_counts
    )


def impossible_result(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> SemiMarkovForwardBackward:
    """What is found where no path explains the steps."""
    return SemiMarkovForwardBackward(
        -np.inf,
        np.zeros_like(log_emissions),
        np.zeros_like(tables.transitions),
        np.zeros_like(tables.log_segment_weights),
        np.zeros_like(tables.log_tail_weights),
    )


def log_segments_from(
    b: int, log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> Float[Array, "s K"]:
    """Log p(the next s steps, the visit lasts s | it begins after b), s = 1, 2 ... until another follows."""
    log_weights = tables.log_segment_weights[int(b == 0)]
    cumulative = np.cumsum(log_emissions[b:-1][: len(log_weights)], axis=0)
    return np.asarray(cumulative + log_weights[: len(cumulative)])


def log_last_segments(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> Float[Array, "T K"]:
    """Log p(all later steps, no visit follows | the visit begins after b)."""
    T = len(log_emissions)
    remaining = np.cumsum(log_emissions[::-1], axis=0)[::-1]
    for b in range(T):
        remaining[b] += last_segment(tables.log_segment_weights[2:], tables.log_tail_weights, T - b)[
            int(b == 0)
        ]
    return remaining


def last_segment(
    segments: Float[Array, "2 S K"], tail_counts: Float[Array, "2 K"], s: int
) -> Float[Array, "2 K"]:
    """The entries of the last visit, that of s recorded steps, and of the only one."""
    return segments[:, s - 1] if s <= segments.shape[1] else tail_counts


def log_forward_variables(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
    """Starts and ends, every visit carried forward to where it may end."""
    starts, ends = np.empty_like(log_emissions), np.full_like(log_emissions, -np.inf)
    log_transitions = log_probability_array(tables.transitions)
    for b in range(len(starts)):
        reached = np.logaddexp.reduce(ends[b][:, None] + log_transitions, axis=0)  # over where from, (K,)
        starts[b] = reached if b > 0 else log_probability_array(tables.initial)
        steps = log_segments_from(b, log_emissions, tables)
        until = slice(b + 1, b + 1 + len(steps))
        ends[until] = np.logaddexp(ends[until], starts[b] + steps)
    return starts, ends


def log_backward_variables(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
    """Log p(all later steps | a visit begins after b), and given that one ends with t and another follows."""
    after_starts, after_ends = log_last_segments(log_emissions, tables), np.empty_like(log_emissions)
    log_transitions = log_probability_array(tables.transitions)
    for b in range(len(after_starts) - 1, -1, -1):
        steps = log_segments_from(b, log_emissions, tables)
        followed = np.logaddexp.reduce(steps + after_ends[b + 1 : b + 1 + len(steps)], axis=0)
        after_starts[b] = np.logaddexp(after_starts[b], followed)
        after_ends[b] = np.logaddexp.reduce(log_transitions + after_starts[b], axis=1)  # over where to
    return after_starts, after_ends


def expected_transitions(
    ends: Float[Array, "T K"], tables: SemiMarkovTables, log_share: Float[Array, "T K"]
) -> Float[Array, "K K"]:
    """Sum over t of p(a visit to j ends with step t and one to k follows | all steps).

    log_share is log p(all later steps | a visit to k begins after t) / p(all steps).
    """
    changes = np.empty_like(tables.transitions)
    for j, row in enumerate(log_probability_array(tables.transitions)):
        changes[j] = np.exp(ends[:, j, None] + row + log_share).sum(axis=0)
    return changes


def state_probabilities(starting: Float[Array, "T K"], ending: Float[Array, "T K"]) -> Float[Array, "T K"]:
    """p(state k at t): all visits that have begun less those that have ended; rounding is put right."""
    smoothed_state_probs = np.cumsum(starting - ending, axis=0).clip(min=0.0)
    return np.asarray(smoothed_state_probs / smoothed_state_probs.sum(axis=1, keepdims=True))


def semi_markov_forward(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForward:
    """Of every step, what the recording would say of its state had it ended there.

    Cost: O(T K (K + T)); compiled, O(T K (K + S)).
    Source: Yu 2010, the explicit duration model; Tanwani 2018, equations 3.40-3.41.
    """
    S, log_transitions = tables.log_segment_weights.shape[1], log_probability_array(tables.transitions)
    ends, state_probs = np.full((2, *log_emissions.shape), -np.inf)
    for b in range(len(log_emissions)):
        first = int(b == 0)
        reached = np.logaddexp.reduce(ends[b - 1][:, None] + log_transitions, axis=0)
        start = log_probability_array(tables.initial) if first else reached
        segments = start + np.cumsum(log_emissions[b:], axis=0)  # (T - b, K), of 1, 2 ... steps
        ended = segments[:S] + tables.log_segment_weights[first, : len(segments)]
        ends[b : b + S] = np.logaddexp(ends[b : b + S], ended)
        segments[:S] += tables.log_segment_weights[2 + first, : len(segments)]
        segments[S:] += tables.log_tail_weights[first]
        state_probs[b:] = np.logaddexp(state_probs[b:], segments)
    return SemiMarkovForward(ends, state_probs)


def semi_markov_viterbi(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> ViterbiPath:
    """The most probable path; at a tie the lower state index, the last step decided first.

    Source: Viterbi 1967, over pairs of state and duration.
    """
    relative, log_offset = subtract_best_path(log_emissions, lambda rows: best_path(rows, tables))
    found = best_path(relative, tables)
    return ViterbiPath(found.states, found.log_probability + log_offset)


def best_path(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> ViterbiPath:
    """Compute the most probable path by the recursion of Viterbi over states and durations, once."""
    log_transitions = log_probability_array(tables.transitions)
    starts, ends = (
        np.empty_like(log_emissions),
        np.full_like(log_emissions, -np.inf),
    )  # of the best path alone
    # The best state before the visit that begins after b; b of the best visit that ends with step t.
    origins, begins = np.zeros((2, *log_emissions.shape), dtype=np.int64)
    for b in range(len(starts)):
        scores = ends[b][:, None] + log_transitions  # from, to
        origins[b] = scores.argmax(axis=0)  # argmax takes the first of equals
        starts[b] = scores.max(axis=0) if b > 0 else log_probability_array(tables.initial)
        steps = starts[b] + log_segments_from(b, log_emissions, tables)
        until = slice(b + 1, b + 1 + len(steps))
        better = (steps > ends[until]) | ((steps == ends[until]) & wins_tie(origins[b]))
        ends[until] = np.where(better, steps, ends[until])
        begins[until] = np.where(better, b, begins[until])
    last = starts + log_last_segments(log_emissions, tables)
    state = int(last.max(axis=0).argmax())
    begin = 0
    for b in range(1, len(last)):
        if last[b, state] > last[begin, state] or (
            last[b, state] == last[begin, state] and wins_tie(origins[b])[state]
        ):
            begin = b
    states = np.full(len(starts), state)
    while begin > 0:
        state = int(origins[begin, state])
        begin, end = int(begins[begin, state]), begin
        states[begin:end] = state
    return ViterbiPath(states, float(last.max()))


def wins_tie(origins: Int[Array, " K"]) -> Array:
    """Whether a shorter visit wins at a tie: the step before it is of a lower state than its own."""
    return origins < np.arange(len(origins))
