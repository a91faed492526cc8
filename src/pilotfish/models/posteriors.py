"""Where a chain was, given all that was observed: occupancy, which knows the past only, smoothed."""

from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.models.dynamics import Dynamics, MarkovChain, MixtureWeights
from pilotfish.models.segments import extend_max_duration, segment_tables
from pilotfish.types import Array, Float


def smoothed_state_probs(dynamics: Dynamics, log_observed: Float[Array, "T K"]) -> Float[Array, "T K"]:
    """p(state i at step t | all T observations); rows sum to one.

    log_observed[t, i] = log p(x_t | state i); a row of zeros is a step that was not observed. What follows
    step T is unknown: visits may go on beyond it.
    Raises: InvalidInput, when there is no step or a log-probability is not finite.
    Source: Rabiner 1989, eq. 27; Yu 2010 for explicit durations.
    """
    if not len(log_observed):
        raise InvalidInput("there are no steps, expected at least one observation or a row of zeros")
    if not np.isfinite(log_observed).all():
        t, i = np.argwhere(~np.isfinite(log_observed))[0]
        raise InvalidInput(
            f"log p of observation {t} in state {i} is {log_observed[t, i]}, expected a finite number; check "
            "that it is finite and in the units of the demonstrations"
        )
    relative = np.ascontiguousarray(log_observed - log_observed.max(axis=1, keepdims=True))
    if isinstance(dynamics, MixtureWeights):
        weighted = dynamics.weights * np.exp(relative)
        return np.asarray(weighted / weighted.sum(axis=1, keepdims=True))
    if isinstance(dynamics, MarkovChain):
        return kernels.forward_backward(relative, dynamics.initial, dynamics.transitions).smoothed_state_probs
    right_censored = replace(dynamics, censoring=replace(dynamics.censoring, right=True))
    return extend_max_duration(
        dynamics.durations,
        len(relative),
        lambda max_duration: kernels.semi_markov(relative, segment_tables(right_censored, max_duration)),
        lambda found: np.array(found.log_likelihood),
    ).smoothed_state_probs
