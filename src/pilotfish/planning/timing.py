"""Durations of the states of a plan, given their order and the number of steps.

The most probable durations d_1, ..., d_n of segments with means m_i and variances v_i that add up to T steps
are, in real numbers and for Gaussian durations,

    d_i = m_i + v_i / (v_1 + ... + v_n) (T - m_1 - ... - m_n).

A Viterbi sequence has whole durations, each rounded by itself: of 30 states that should last 3.5 steps, half
last 3 and half 4, in any order, and the motion is early or late by several steps in between. Here the sums
d_1 + ... + d_i are rounded instead, so that no segment begins more than half a step early or late.
"""

import numpy as np

from pilotfish.models import state_segments
from pilotfish.models.durations import DurationDistribution
from pilotfish.types import Array, Int


def share_time(states: Int[Array, " T"], durations: DurationDistribution) -> Int[Array, " T"]:
    """Return the same order of states with their most probable durations.

    Args:
        states: State of each step.
        durations: Duration distributions; those that are not Gaussian count with their mean and variance.

    Source:
        The mean of a Gaussian given the sum of its independent entries.
    """
    order, _ = state_segments(states)
    T, n = len(states), len(order)
    means, variances = durations.means[order], durations.deviations[order] ** 2
    total = variances.sum()
    shares = variances / total if total > 0.0 else np.full(n, 1.0 / n)
    expected = means + shares * (T - means.sum())
    if (expected <= 0.0).any():  # much faster than the demonstrations
        expected = means * T / means.sum()
    ends = _distinct(np.cumsum(expected).round().astype(np.int64), T)
    return np.repeat(order, np.diff(ends, prepend=0))


def _distinct(ends: Int[Array, " n"], T: int) -> Int[Array, " n"]:
    """Return ascending ends, the last of them T, so that every segment has a step."""
    order = np.arange(len(ends))
    ends = np.maximum.accumulate(np.maximum(ends - order, 1)) + order
    ends = np.minimum(ends, T - order[::-1])
    ends[-1] = T
    return np.asarray(ends)
