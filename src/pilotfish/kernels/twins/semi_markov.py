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
from pilotfish.kernels.results import SemiMarkov, SemiMarkovForward, Viterbi
from pilotfish.kernels.twins.chain import log_or_never, relative_to_best_path
from pilotfish.types import Array, Float, Int


def semi_markov(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkov:
    """Posteriors of the states and visits of one demonstration.

    Emissions may be -inf, and differ by any number of nats; weights and probabilities may be zero. A visit
    that lasts until the recording ends is of kind 2 or 3, even if both end together.
    Cost: O(T K (K + S)).
    Source: Yu 2010, the explicit duration model; Guedon 2003 for a last visit that is cut short. Ours: the
    same for a first visit.
    """
    relative, taken = relative_to_best_path(log_emissions, lambda rows: best_path(rows, tables))
    starts, ends = log_forwards(relative, tables)
    last = starts + log_last_visits(relative, tables)  # (T, K), log p(all steps, this is the last visit)
    log_likelihood = float(np.logaddexp.reduce(last, axis=None))
    if log_likelihood == -np.inf:
        return nowhere(log_emissions, tables)
    after_starts, after_ends = log_backwards(relative, tables)
    visits, beyond = np.zeros_like(tables.log_visits), np.zeros_like(tables.log_beyond)
    finished = np.zeros_like(ends)  # (T, K), expected number of visits that end with step t
    for b, final in enumerate(np.exp(last - log_likelihood)):
        steps = log_visits_from(b, relative, tables)  # (s, K), those that end before the recording
        until = slice(b + 1, b + 1 + len(steps))
        expected = np.exp(starts[b] + steps + after_ends[until] - log_likelihood)
        visits[int(b == 0), : len(steps)] += expected
        finished[until] += expected
        last_visit(visits[2:], beyond, len(ends) - b)[int(b == 0)] += final
    begun = np.exp(starts + after_starts - log_likelihood)
    changes = expected_changes(ends, tables, after_starts - log_likelihood)
    return SemiMarkov(log_likelihood + taken, occupied(begun, finished), changes, visits, beyond)


def nowhere(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkov:
    """What is found where no path explains the steps."""
    return SemiMarkov(
        -np.inf,
        np.zeros_like(log_emissions),
        np.zeros_like(tables.transitions),
        np.zeros_like(tables.log_visits),
        np.zeros_like(tables.log_beyond),
    )


def log_visits_from(
    b: int, log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> Float[Array, "s K"]:
    """log p(the next s steps, the visit lasts s | it begins after b), s = 1, 2 ... until another follows."""
    log_weights = tables.log_visits[int(b == 0)]
    seen = np.cumsum(log_emissions[b:-1][: len(log_weights)], axis=0)
    return np.asarray(seen + log_weights[: len(seen)])


def log_last_visits(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> Float[Array, "T K"]:
    """log p(all later steps, no visit follows | the visit begins after b)."""
    T = len(log_emissions)
    remaining = np.cumsum(log_emissions[::-1], axis=0)[::-1]
    for b in range(T):
        remaining[b] += last_visit(tables.log_visits[2:], tables.log_beyond, T - b)[int(b == 0)]
    return remaining


def last_visit(visits: Float[Array, "2 S K"], beyond: Float[Array, "2 K"], s: int) -> Float[Array, "2 K"]:
    """The entries of the last visit, that of s recorded steps, and of the only one."""
    return visits[:, s - 1] if s <= visits.shape[1] else beyond


def log_forwards(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
    """starts and ends, every visit carried forward to where it may end."""
    starts, ends = np.empty_like(log_emissions), np.full_like(log_emissions, -np.inf)
    log_transitions = log_or_never(tables.transitions)
    for b in range(len(starts)):
        reached = np.logaddexp.reduce(ends[b][:, None] + log_transitions, axis=0)  # over where from, (K,)
        starts[b] = reached if b > 0 else log_or_never(tables.initial)
        steps = log_visits_from(b, log_emissions, tables)
        until = slice(b + 1, b + 1 + len(steps))
        ends[until] = np.logaddexp(ends[until], starts[b] + steps)
    return starts, ends


def log_backwards(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
    """log p(all later steps | a visit begins after b), and given that one ends with t and another follows."""
    after_starts, after_ends = log_last_visits(log_emissions, tables), np.empty_like(log_emissions)
    log_transitions = log_or_never(tables.transitions)
    for b in range(len(after_starts) - 1, -1, -1):
        steps = log_visits_from(b, log_emissions, tables)
        followed = np.logaddexp.reduce(steps + after_ends[b + 1 : b + 1 + len(steps)], axis=0)
        after_starts[b] = np.logaddexp(after_starts[b], followed)
        after_ends[b] = np.logaddexp.reduce(log_transitions + after_starts[b], axis=1)  # over where to
    return after_starts, after_ends


def expected_changes(
    ends: Float[Array, "T K"], tables: SemiMarkovTables, log_share: Float[Array, "T K"]
) -> Float[Array, "K K"]:
    """Sum over t of p(a visit to j ends with step t and one to k follows | all steps).

    log_share is log p(all later steps | a visit to k begins after t) / p(all steps).
    """
    changes = np.empty_like(tables.transitions)
    for j, row in enumerate(log_or_never(tables.transitions)):
        changes[j] = np.exp(ends[:, j, None] + row + log_share).sum(axis=0)
    return changes


def occupied(begun: Float[Array, "T K"], finished: Float[Array, "T K"]) -> Float[Array, "T K"]:
    """p(state k at t): all visits that have begun less those that have ended; rounding is put right."""
    posteriors = np.cumsum(begun - finished, axis=0).clip(min=0.0)
    return np.asarray(posteriors / posteriors.sum(axis=1, keepdims=True))


def semi_markov_forward(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForward:
    """Of every step, what the recording would say of its state had it ended there.

    Cost: O(T K (K + T)); compiled, O(T K (K + S)).
    Source: Yu 2010, the explicit duration model; Tanwani 2018, equations 3.40-3.41.
    """
    S, log_transitions = tables.log_visits.shape[1], log_or_never(tables.transitions)
    ends, occupancy = np.full((2, *log_emissions.shape), -np.inf)
    for b in range(len(log_emissions)):
        first = int(b == 0)
        reached = np.logaddexp.reduce(ends[b - 1][:, None] + log_transitions, axis=0)
        start = log_or_never(tables.initial) if first else reached
        visits = start + np.cumsum(log_emissions[b:], axis=0)  # (T - b, K), of 1, 2 ... steps
        ended = visits[:S] + tables.log_visits[first, : len(visits)]
        ends[b : b + S] = np.logaddexp(ends[b : b + S], ended)
        visits[:S] += tables.log_visits[2 + first, : len(visits)]
        visits[S:] += tables.log_beyond[first]
        occupancy[b:] = np.logaddexp(occupancy[b:], visits)
    return SemiMarkovForward(ends, occupancy)


def semi_markov_viterbi(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> Viterbi:
    """The most probable path; at a tie the lower state index, the last step decided first.

    Source: Viterbi 1967, over pairs of state and duration.
    """
    relative, taken = relative_to_best_path(log_emissions, lambda rows: best_path(rows, tables))
    found = best_path(relative, tables)
    return Viterbi(found.states, found.log_probability + taken)


def best_path(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> Viterbi:
    """Compute the most probable path by the recursion of Viterbi over states and durations, once."""
    log_transitions = log_or_never(tables.transitions)
    starts, ends = (
        np.empty_like(log_emissions),
        np.full_like(log_emissions, -np.inf),
    )  # of the best path alone
    # The best state before the visit that begins after b; b of the best visit that ends with step t.
    origins, begins = np.zeros((2, *log_emissions.shape), dtype=np.int64)
    for b in range(len(starts)):
        scores = ends[b][:, None] + log_transitions  # from, to
        origins[b] = scores.argmax(axis=0)  # argmax takes the first of equals
        starts[b] = scores.max(axis=0) if b > 0 else log_or_never(tables.initial)
        steps = starts[b] + log_visits_from(b, log_emissions, tables)
        until = slice(b + 1, b + 1 + len(steps))
        better = (steps > ends[until]) | ((steps == ends[until]) & lower(origins[b]))
        ends[until] = np.where(better, steps, ends[until])
        begins[until] = np.where(better, b, begins[until])
    last = starts + log_last_visits(log_emissions, tables)
    state = int(last.max(axis=0).argmax())
    begin = 0
    for b in range(1, len(last)):
        if last[b, state] > last[begin, state] or (
            last[b, state] == last[begin, state] and lower(origins[b])[state]
        ):
            begin = b
    states = np.full(len(starts), state)
    while begin > 0:
        state = int(origins[begin, state])
        begin, end = int(begins[begin, state]), begin
        states[begin:end] = state
    return Viterbi(states, float(last.max()))


def lower(origins: Int[Array, " K"]) -> Array:
    """Whether a shorter visit wins at a tie: the step before it is of a lower state than its own."""
    return origins < np.arange(len(origins))
