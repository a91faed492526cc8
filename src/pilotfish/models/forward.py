"""Recursions over time of a chain: the forward variable, occupancy, filtering and prediction (3.38-3.41)."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.models.dynamics import Dynamics, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.segments import extend_max_duration, segment_tables
from pilotfish.types import Array, Float
from pilotfish.validation import require_count

MAX_HORIZON = 1_000_000  # steps
MAX_STATE_PROBS = 2**24  # numbers for every step and state; a few arrays of them are held at a time


@dataclass(frozen=True, slots=True, eq=False)
class ForwardVariables:
    """log_ends[t, i] = log p(observed up to t, a visit to state i ends with step t): alpha of (3.40).

    log_occupancy[t, i] = log p(observed up to t, state i at step t). Steps beyond the observations count
    transitions and durations only.
    """

    log_segment_ends: Float[Array, "T K"]
    log_forward: Float[Array, "T K"]


def semi_markov_forward(
    chain: SemiMarkovChain, log_observed: Float[Array, "S K"], horizon: int
) -> ForwardVariables:
    """The forward variable of a semi-Markov chain over horizon steps, of which the first S are observed.

    log_observed[t, i] = log p(x_t | state i). A final state is never left, so no visit to it ends.
    Visits are followed as far as matters, to 1e-8 nats a step.
    Cost: O(T K (K + L)), L the longest visit that is followed.
    Source: Tanwani 2018, equations 3.40-3.41, with the segments that begin at t = 1, which (3.40) forgets.
    """
    _validate_observations(log_observed, horizon)
    log_unobserved = np.zeros((horizon - len(log_observed), log_observed.shape[1]))  # they speak for no state
    log_emissions = np.concatenate([log_observed, log_unobserved])
    right_censored = replace(chain, censoring=replace(chain.censoring, right=True))

    def compute(max_duration: int) -> kernels.SemiMarkovForward:
        return kernels.semi_markov_forward(log_emissions, segment_tables(right_censored, max_duration))

    forward = extend_max_duration(
        chain.durations, horizon, compute, lambda one: np.logaddexp.reduce(one.log_forward, axis=1)
    )
    return ForwardVariables(forward.log_segment_ends, forward.log_forward)


def markov_forward(
    chain: MarkovChain, log_observed: Float[Array, "S K"], horizon: int
) -> Float[Array, "T K"]:
    """Log p(observed up to t, state i at step t) of a Markov chain (3.8), t = 1 ... horizon."""
    _validate_observations(log_observed, horizon)
    log_forward = np.empty((horizon, len(chain.initial)))
    with np.errstate(divide="ignore"):
        log_prediction, log_transitions = np.log(chain.initial), np.log(chain.transitions)
    for t in range(horizon):
        log_forward[t] = log_prediction + (log_observed[t] if t < len(log_observed) else 0.0)
        log_prediction = np.logaddexp.reduce(log_forward[t][:, None] + log_transitions, axis=0)
    return log_forward


def filtered_state_probs(
    dynamics: Dynamics, log_observed: Float[Array, "S K"], horizon: int
) -> Float[Array, "T K"]:
    """p(state i at step t | what was observed up to t); rows sum to one.

    Within the observed prefix this is filtering (3.38), beyond it prediction (3.41). With no observation
    (S = 0) it is the skill's own expectation.
    Raises: InvalidInput, when a log-probability is not finite or the model has no dynamics.
    """
    if isinstance(dynamics, MixtureWeights):
        raise InvalidInput(
            "a mixture has no order in time, so no occupancy; learn a Markov or semi-Markov skill"
        )
    _validate_observations(log_observed, horizon)
    log_observed = log_observed - log_observed.max(axis=1, keepdims=True, initial=-np.inf)  # rows sum to one
    if isinstance(dynamics, SemiMarkovChain):
        log_p = semi_markov_forward(dynamics, log_observed, horizon).log_forward
    else:
        log_p = markov_forward(dynamics, log_observed, horizon)
    return np.asarray(np.exp(log_p - np.logaddexp.reduce(log_p, axis=1)[:, None]))


def _validate_observations(log_observed: Float[Array, "S K"], horizon: int) -> None:
    require_count(horizon, "horizon", MAX_HORIZON, max(1, len(log_observed)))
    if horizon * log_observed.shape[1] > MAX_STATE_PROBS:
        most = MAX_STATE_PROBS // log_observed.shape[1]
        raise InvalidInput(f"horizon is {horizon} steps, expected at most {most} for so many states")
    if not np.isfinite(log_observed).all():
        t, i = np.argwhere(~np.isfinite(log_observed))[0]
        raise InvalidInput(
            f"log p of observation {t} in state {i} is {log_observed[t, i]}, expected a finite number; check "
            "that start and frames are finite and in the units of the demonstrations"
        )
