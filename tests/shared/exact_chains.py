"""Markov and semi-Markov recursions in 60-digit arithmetic: the reference of the kernels for narrow states.

The recursions are those of the kernels' NumPy references, in probabilities instead of logarithms. mpmath's
exponents are unbounded, so that nothing underflows, and 60 digits leave more than 40 after cancellation.
"""

from dataclasses import dataclass

import mpmath
import numpy as np
from mpmath import mpf

from pilotfish.kernels import SemiMarkovTables

DIGITS = 60


@dataclass
class ExactInference:
    """Result of a recursion, rounded to float64 at the end."""

    log_likelihood: float
    smoothed_state_probs: np.ndarray  # (T, K)
    transition_counts: np.ndarray  # (K, K)
    log_forward: np.ndarray  # (T, K), log p(steps 0 to t, state k at t)
    best_log_probability: float  # log-probability of the most probable path
    path: list[int]


def mpf_exponentials(log_floats):
    """Return exp of every entry, as an object array of mpf."""
    values = np.asarray(log_floats, dtype=float)
    flat = [mpf(0) if value == -np.inf else mpmath.exp(mpf(float(value))) for value in values.ravel()]
    return np.array([*flat, None], dtype=object)[:-1].reshape(values.shape)


def to_mpf(values):
    """Return the numbers as mpf."""
    return np.array([*(mpf(float(value)) for value in np.ravel(values)), None], dtype=object)[:-1].reshape(
        np.shape(values)
    )


def log_float(value) -> float:
    return float(mpmath.log(value)) if value > 0 else -np.inf


def log_floats(values) -> np.ndarray:
    return np.array([log_float(value) for value in values.ravel()]).reshape(values.shape)


def to_floats(values) -> np.ndarray:
    return np.array([float(value) for value in np.ravel(values)]).reshape(np.shape(values))


def markov(log_emissions, initial, transitions) -> ExactInference:
    """Return state probabilities, expected transitions, likelihood and best path of a Markov chain."""
    with mpmath.workdps(DIGITS):
        emissions, a = mpf_exponentials(log_emissions), to_mpf(transitions)
        (T, K), first = emissions.shape, to_mpf(initial)
        forward, best_log_probability = [first * emissions[0]], [first * emissions[0]]
        origins = []
        for t in range(1, T):
            forward.append((forward[-1] @ a) * emissions[t])
            scores = best_log_probability[-1][:, None] * a
            origins.append([max(range(K), key=lambda j, k=k: scores[j, k]) for k in range(K)])
            best_log_probability.append(
                np.array([scores[j, k] for k, j in enumerate(origins[-1])]) * emissions[t]
            )
        backward = [np.array([mpf(1)] * K)]
        for t in range(T - 1, 0, -1):
            backward.insert(0, a @ (emissions[t] * backward[0]))
        evidence = sum(forward[-1])
        smoothed_state_probs = np.array(forward) * np.array(backward) / evidence
        transition_counts = sum(
            (np.outer(forward[t - 1], emissions[t] * backward[t]) * a / evidence for t in range(1, T)),
            np.zeros((K, K)),
        )
        path = [max(range(K), key=lambda k: best_log_probability[-1][k])]
        for origin in reversed(origins):
            path.insert(0, origin[path[0]])
        return ExactInference(
            log_float(evidence),
            to_floats(smoothed_state_probs),
            to_floats(transition_counts),
            log_floats(np.array(forward)),
            log_float(max(best_log_probability[-1])),
            path,
        )


def semi_markov(log_emissions, tables: SemiMarkovTables) -> ExactInference:
    """Return the same for a semi-Markov chain with the weights of the tables."""
    with mpmath.workdps(DIGITS):
        emissions, a = mpf_exponentials(log_emissions), to_mpf(tables.transitions)
        weights, tail_weights = (
            mpf_exponentials(tables.log_segment_weights),
            mpf_exponentials(tables.log_tail_weights),
        )
        (T, K), S = emissions.shape, weights.shape[1]
        nothing = np.array([mpf(0)] * K)
        starts, ends = [to_mpf(tables.initial)], [nothing] * (T + 1)
        best_ends: list = [[(mpf(0), None)] * K for _ in range(T + 1)]  # probability, begin
        best_starts, origins = [to_mpf(tables.initial)], [None]
        filtered = [nothing] * T
        last, best_last = [], []  # of segments that begin at b and are the last
        for b in range(T):
            if b > 0:
                starts.append(ends[b] @ a)
                scores = np.array([p for p, _ in best_ends[b]])[:, None] * a
                origins.append([max(range(K), key=lambda j, k=k: scores[j, k]) for k in range(K)])
                best_starts.append(np.array([scores[j, k] for k, j in enumerate(origins[b])]))
            kind, segment = int(b == 0), np.array([mpf(1)] * K)
            for s in range(1, T - b + 1):
                segment = segment * emissions[b + s - 1]
                final = weights[2 + kind, s - 1] if s <= S else tail_weights[kind]
                filtered[b + s - 1] = filtered[b + s - 1] + starts[b] * segment * final
                if s <= S and b + s < T:
                    ended = segment * weights[kind, s - 1]
                    ends[b + s] = ends[b + s] + starts[b] * ended
                    for k in range(K):
                        candidate = best_starts[b][k] * ended[k]
                        if candidate > best_ends[b + s][k][0]:
                            best_ends[b + s][k] = (candidate, b)
            last.append(starts[b] * segment * final)
            best_last.append(best_starts[b] * segment * final)
        evidence = sum(sum(row) for row in last)
        if evidence == 0:
            return ExactInference(
                -np.inf, np.zeros((T, K)), np.zeros((K, K)), log_floats(np.array(filtered)), -np.inf, []
            )
        smoothed_state_probs, transition_counts = _smoothed_state_probs(
            emissions, a, weights, starts, ends, last, evidence
        )
        most, b, k = max(((p, b, k) for b, row in enumerate(best_last) for k, p in enumerate(row)))
        path = [k] * (T - b)
        while b > 0:
            k = origins[b][k]
            begin = best_ends[b][k][1]
            path, b = [k] * (b - begin) + path, begin
        return ExactInference(
            log_float(evidence),
            to_floats(smoothed_state_probs),
            to_floats(transition_counts),
            log_floats(np.array(filtered)),
            log_float(most),
            path,
        )


def _smoothed_state_probs(emissions, a, weights, starts, ends, last, evidence):
    """Return p(state k at t) and expected transitions; every segment counts at each of its steps."""
    (T, K), S = emissions.shape, weights.shape[1]
    after_ends = [np.array([mpf(0)] * K)] * (
        T + 1
    )  # p(later steps | a segment ends after t, another follows)
    smoothed_state_probs, transition_counts = np.zeros((T, K), dtype=object), np.zeros((K, K), dtype=object)
    for b in range(T - 1, -1, -1):
        begun = last[b] / evidence
        smoothed_state_probs[b:] = smoothed_state_probs[b:] + begun
        after_starts = last[b] / nonzero_starts(starts[b])
        segment = np.array([mpf(1)] * K)
        for s in range(1, min(S, T - b - 1) + 1):
            segment = segment * emissions[b + s - 1]
            ahead = segment * weights[int(b == 0), s - 1] * after_ends[b + s]
            smoothed_state_probs[b : b + s] = smoothed_state_probs[b : b + s] + starts[b] * ahead / evidence
            after_starts = after_starts + ahead
        if b > 0:
            after_ends[b] = a @ after_starts
            transition_counts = transition_counts + np.outer(ends[b], after_starts) * a / evidence
    return smoothed_state_probs, transition_counts


def nonzero_starts(starts):
    """Return divisors that are one where no segment starts."""
    return np.array([value if value > 0 else mpf(1) for value in starts])
