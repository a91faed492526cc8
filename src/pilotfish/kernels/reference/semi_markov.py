"""Forward-backward and Viterbi of a hidden semi-Markov model, with left- and right-censored segments.

Model. The chain enters state k, stays for s steps (a segment), then moves to another state j with probability
a_kj, a_kk = 0. Given the states, steps are independent with densities b_k(x_t). A recording of T steps may
begin inside its first segment (left-censored) and end inside its last one (right-censored). So the weight of
s recorded steps depends on the kind c of the segment, w_c(s, k) in `SemiMarkovTables`: 0 inside the
recording, 1 first, 2 last, 3 first and last. The duration distribution enters only through w: w_0(s) = p(s);
for a right-censored last segment w_2(s) = sum over d >= s of p(d); w_1 and w_3 follow in the same way for a
segment that began before the recording. Kinds 2 and 3 may exceed the table of S steps; log_tail_weights gives
their constant weight.

Variables. B_t(k) = sum of log b_k(x_u) over u < t, so that a segment over steps b .. b+s-1 has log-emission
B_{b+s}(k) - B_b(k). With c = 1 if b = 0, else 0, and c' = c + 2:

    starts_b(k) = log p(x_0 .. x_{b-1}, a segment of k begins at step b)
    ends_t(k)   = log p(x_0 .. x_{t-1}, a segment of k ends before step t, and another one follows)

Forward recursion, for b = 0 .. T-1 and t = 1 .. T-1:

    starts_0(k) = log pi_k
    ends_t(k)   = logsumexp over b < t, t - b <= S of starts_b(k) + log w_c(t - b, k) + B_t(k) - B_b(k)
    starts_t(k) = logsumexp over j of ends_t(j) + log a_jk
    log p(x)    = logsumexp over b, k of starts_b(k) + log w_c'(T - b, k) + B_T(k) - B_b(k)

Backward recursion, for b = T-1 .. 0, with the same segment terms:

    after_ends_b(j)   = logsumexp over k of log a_jk + after_starts_b(k)
    after_starts_b(k) = logsumexp of the last-segment term above and, over s <= S with b + s < T,
                        log w_c(s, k) + B_{b+s}(k) - B_b(k) + after_ends_{b+s}(k)

Expectations. The expected number of segments of k over steps b .. b+s-1 is
exp(starts_b + log w_c(s) + B_{b+s} - B_b + after_ends_{b+s} - log p(x)). Summed over b it is `segments`,
which the M-step of the durations uses. The expected number that begin at b is exp(starts_b + after_starts_b -
log p(x)). The probability of state k at step t is the number that have begun by t less the number that have
ended.

Rounding. Log-probabilities reach 1e20 in magnitude if states are narrow, while those of the likely paths
differ by a few nats. All recursions therefore run on emissions relative to the most probable path
(`subtract_best_path`): at the nodes of that path and of those close to it, numbers are small. log p(x) adds
the path's emissions again.

Invariants. Results equal the sums over all segmentations. Rows of the state probabilities sum to one;
segments weighted by their recorded steps sum to T.

Keep in step: `log_forward_variables`, `log_backward_variables`, `best_path` and `semi_markov_forward` here
use the same segment terms and last-segment terms, and so does cpp/semi_markov.cpp. Change them together.
"""

import numpy as np

from pilotfish.kernels.arguments import SemiMarkovTables
from pilotfish.kernels.reference.markov import log_probability_array, subtract_best_path
from pilotfish.kernels.results import SemiMarkovForward, SemiMarkovForwardBackward, ViterbiPath
from pilotfish.types import Array, Float, Int


def semi_markov_forward_backward(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> SemiMarkovForwardBackward:
    """Return smoothed state probabilities and expected segments of one demonstration, in O(T K (K + S)).

    Args:
        log_emissions: log b_k(x_t); -inf is allowed, and any range of magnitudes.
        tables: Semi-Markov chain; weights and probabilities may be zero. A segment up to the end of the
            recording is of kind 2 or 3, also if the segment ends exactly there.

    Source:
        Yu 2010, explicit-duration model; Guedon 2003 for a right-censored last segment. Extended to a
        left-censored first segment.
    """
    relative, log_offset = subtract_best_path(log_emissions, lambda rows: best_path(rows, tables))
    starts, ends = log_forward_variables(relative, tables)
    last = starts + log_last_segments(
        relative, tables
    )  # (T, K), log p(all steps, the last segment begins at b)
    log_likelihood = float(np.logaddexp.reduce(last, axis=None))
    if log_likelihood == -np.inf:
        return impossible_result(log_emissions, tables)
    after_starts, after_ends = log_backward_variables(relative, tables)
    segments, long_segment_counts = (
        np.zeros_like(tables.log_segment_weights),
        np.zeros_like(tables.log_tail_weights),
    )
    ending = np.zeros_like(ends)  # (T, K), expected number of segments that end before step t
    for b, expected_last in enumerate(np.exp(last - log_likelihood)):
        steps = log_segments_from(b, relative, tables)  # (s, K), of segments that end before the recording
        until = slice(b + 1, b + 1 + len(steps))
        expected = np.exp(starts[b] + steps + after_ends[until] - log_likelihood)
        segments[int(b == 0), : len(steps)] += expected
        ending[until] += expected
        last_segment(segments[2:], long_segment_counts, len(ends) - b)[int(b == 0)] += expected_last
    starting = np.exp(starts + after_starts - log_likelihood)
    transition_counts = expected_transitions(ends, tables, after_starts - log_likelihood)
    return SemiMarkovForwardBackward(
        log_likelihood + log_offset,
        state_probabilities(starting, ending),
        transition_counts,
        segments,
        long_segment_counts,
    )


def impossible_result(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> SemiMarkovForwardBackward:
    """Return the result if no path has a positive probability."""
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
    """Return log p(the next s steps, segment of s steps | it begins at b), for s < T - b."""
    log_weights = tables.log_segment_weights[int(b == 0)]
    cumulative = np.cumsum(log_emissions[b:-1][: len(log_weights)], axis=0)
    return np.asarray(cumulative + log_weights[: len(cumulative)])


def log_last_segments(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> Float[Array, "T K"]:
    """Return log p(all later steps, no segment follows | a segment begins at b)."""
    T = len(log_emissions)
    remaining = np.cumsum(log_emissions[::-1], axis=0)[::-1]
    for b in range(T):
        remaining[b] += last_segment(tables.log_segment_weights[2:], tables.log_tail_weights, T - b)[
            int(b == 0)
        ]
    return remaining


def last_segment(
    segments: Float[Array, "2 S K"], long_segment_counts: Float[Array, "2 K"], s: int
) -> Float[Array, "2 K"]:
    """Return the entries of a last segment of s recorded steps: kind 2, then kind 3."""
    return segments[:, s - 1] if s <= segments.shape[1] else long_segment_counts


def log_forward_variables(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
    """Return starts and ends, as defined at the head of this file."""
    starts, ends = np.empty_like(log_emissions), np.full_like(log_emissions, -np.inf)
    log_transitions = log_probability_array(tables.transitions)
    for b in range(len(starts)):
        predicted = np.logaddexp.reduce(ends[b][:, None] + log_transitions, axis=0)  # over j, (K,)
        starts[b] = predicted if b > 0 else log_probability_array(tables.initial)
        steps = log_segments_from(b, log_emissions, tables)
        until = slice(b + 1, b + 1 + len(steps))
        ends[until] = np.logaddexp(ends[until], starts[b] + steps)
    return starts, ends


def log_backward_variables(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
    """Return after_starts and after_ends, as defined at the head of this file."""
    after_starts, after_ends = log_last_segments(log_emissions, tables), np.empty_like(log_emissions)
    log_transitions = log_probability_array(tables.transitions)
    for b in range(len(after_starts) - 1, -1, -1):
        steps = log_segments_from(b, log_emissions, tables)
        continued = np.logaddexp.reduce(steps + after_ends[b + 1 : b + 1 + len(steps)], axis=0)
        after_starts[b] = np.logaddexp(after_starts[b], continued)
        after_ends[b] = np.logaddexp.reduce(log_transitions + after_starts[b], axis=1)  # over k
    return after_starts, after_ends


def expected_transitions(
    ends: Float[Array, "T K"], tables: SemiMarkovTables, log_after: Float[Array, "T K"]
) -> Float[Array, "K K"]:
    """Return the sum over t of p(a segment of j ends before step t, one of k follows | all steps).

    log_after is log p(all later steps | a segment of k begins at t) - log p(all steps).
    """
    transition_counts = np.empty_like(tables.transitions)
    for j, row in enumerate(log_probability_array(tables.transitions)):
        transition_counts[j] = np.exp(ends[:, j, None] + row + log_after).sum(axis=0)
    return transition_counts


def state_probabilities(starting: Float[Array, "T K"], ending: Float[Array, "T K"]) -> Float[Array, "T K"]:
    """Return p(state k at t): segments that have begun less those that have ended, normalised."""
    smoothed_state_probs = np.cumsum(starting - ending, axis=0).clip(min=0.0)
    return np.asarray(smoothed_state_probs / smoothed_state_probs.sum(axis=1, keepdims=True))


def semi_markov_forward(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForward:
    """Return filtered log-probabilities, as if the recording ended at each step.

    Cost: O(T K (K + T)); O(T K (K + S)) in the compiled kernel.

    Args:
        log_emissions: log b_k(x_t).
        tables: Semi-Markov chain.

    Source:
        Yu 2010, explicit-duration model; Tanwani 2018, equations 3.40-3.41.
    """
    S, log_transitions = tables.log_segment_weights.shape[1], log_probability_array(tables.transitions)
    ends, log_forward = np.full((2, *log_emissions.shape), -np.inf)
    for b in range(len(log_emissions)):
        is_first = int(b == 0)
        predicted = np.logaddexp.reduce(ends[b - 1][:, None] + log_transitions, axis=0)
        start = log_probability_array(tables.initial) if is_first else predicted
        segments = start + np.cumsum(log_emissions[b:], axis=0)  # (T - b, K), of 1, 2 ... steps
        ended = segments[:S] + tables.log_segment_weights[is_first, : len(segments)]
        ends[b : b + S] = np.logaddexp(ends[b : b + S], ended)
        segments[:S] += tables.log_segment_weights[2 + is_first, : len(segments)]
        segments[S:] += tables.log_tail_weights[is_first]
        log_forward[b:] = np.logaddexp(log_forward[b:], segments)
    return ends, log_forward


def semi_markov_viterbi(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> ViterbiPath:
    """Return the most probable path; among equally probable ones, the last step has the lower state index.

    Args:
        log_emissions: log b_k(x_t).
        tables: Semi-Markov chain.

    Source:
        Viterbi 1967, over pairs of state and duration.
    """
    relative, log_offset = subtract_best_path(log_emissions, lambda rows: best_path(rows, tables))
    states, log_probability = best_path(relative, tables)
    return states, log_probability + log_offset


def best_path(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> ViterbiPath:
    """Return the result of one Viterbi recursion over states and durations."""
    log_transitions = log_probability_array(tables.transitions)
    starts, ends = np.empty_like(log_emissions), np.full_like(log_emissions, -np.inf)  # maxima over paths
    # Best state before the segment that begins at b; b of the best segment that ends before step t.
    origins, begins = np.zeros((2, *log_emissions.shape), dtype=np.int64)
    for b in range(len(starts)):
        scores = ends[b][:, None] + log_transitions  # [j, k]
        origins[b] = scores.argmax(axis=0)  # the first of equal scores
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
    return states, float(last.max())


def wins_tie(origins: Int[Array, " K"]) -> Array:
    """Return whether a shorter segment wins at a tie: the step before it has a lower state than its own."""
    return origins < np.arange(len(origins))
