"""Recursions over time of a chain: the forward variable, occupancy, filtering and prediction (3.38-3.41)."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput, require_kind
from pilotfish.models.dynamics import Dynamics, MarkovChain, SemiMarkovChain, Weights, final_states
from pilotfish.models.visits import log_tails
from pilotfish.types import Array, Float

LOST = 1e-12  # a visit outlasts what is followed of it with less probability


@dataclass(frozen=True, slots=True, eq=False)
class Forward:
    """log_ends[t, i] = log p(observed up to t, a visit to state i ends with step t): alpha of (3.40).

    log_occupancy[t, i] = log p(observed up to t, state i at step t). Steps beyond the observations count
    transitions and durations only.
    """

    log_ends: Float[Array, "T K"]
    log_occupancy: Float[Array, "T K"]


def semi_markov_forward(chain: SemiMarkovChain, log_observed: Float[Array, "S K"], horizon: int) -> Forward:
    """The forward variable of a semi-Markov chain over horizon steps, of which the first S are observed.

    log_observed[t, i] = log p(x_t | state i). A final state is never left, so no visit to it ends.
    Cost: O(T K (K + L)), L the longest duration, or the S observed steps where these are more.
    Source: Tanwani 2018, equations 3.40-3.41, with the segments that begin at t = 1, which (3.40) forgets.
    """
    _check(log_observed, horizon)
    (S, K) = log_observed.shape
    longest = min(horizon, max(S, chain.durations.longest(LOST)))  # observed, any visit may have lasted
    log_last, log_longer = _log_visits(chain, longest)
    # The best of each step is taken out, and put back at the end: differences of sums keep their digits.
    best = log_observed.max(axis=1, initial=-np.inf)
    seen = np.zeros((horizon + 1, K))
    seen[1 : S + 1] = np.cumsum(log_observed - best[:, None], axis=0)
    seen[S + 1 :] = seen[S]  # unobserved steps speak for no state
    log_starts, log_ends, log_occupancy = np.full((3, horizon + 1, K), -np.inf)
    with np.errstate(divide="ignore"):
        log_starts[0], log_transitions = np.log(chain.initial), np.log(chain.transitions)
    settled = np.where(final_states(chain), 0.0, -np.inf)  # only final states outlast the longest visit
    log_settled = np.full(K, -np.inf)
    for t in range(1, horizon + 1):
        d = np.arange(1, min(longest, t) + 1)  # how long the visit has lasted
        visits = log_starts[t - d] + seen[t] - seen[t - d]
        if longest < t:
            begun = t - longest - 1
            log_settled = np.logaddexp(log_settled, log_starts[begun] - seen[begun] + settled)
        first = (d == t).astype(np.int64)  # one for the visit that is the first
        log_ends[t] = np.logaddexp.reduce(visits + log_last[first, d - 1], axis=0)
        lasting = np.logaddexp.reduce(visits + log_longer[first, d - 1], axis=0)
        log_occupancy[t] = np.logaddexp(lasting, log_settled + seen[t])
        log_starts[t] = np.logaddexp.reduce(log_ends[t][:, None] + log_transitions, axis=0)
    taken = np.cumsum(np.append(best, np.zeros(horizon - S)))[:, None]
    return Forward(log_ends[1:] + taken, log_occupancy[1:] + taken)


def _log_visits(chain: SemiMarkovChain, longest: int) -> tuple[Float[Array, "2 L K"], Float[Array, "2 L K"]]:
    """log p(a visit lasts exactly d) and log p(it lasts d or more), d = 1 ... longest.

    [0] of one that begins after the first step, [1] of the first one, which may have begun before it.
    """
    last = chain.durations.log_table(longest)
    longer, excess = log_tails(chain.durations, longest)
    lasts, lasts_longer = np.stack([last, last]), np.stack([longer, longer])
    if chain.censoring.first:
        lasts[1], lasts_longer[1] = longer - excess[0], excess - excess[0]
    final = final_states(chain)
    return np.where(final, -np.inf, lasts), np.where(final, 0.0, lasts_longer)


def markov_forward(
    chain: MarkovChain, log_observed: Float[Array, "S K"], horizon: int
) -> Float[Array, "T K"]:
    """log p(observed up to t, state i at step t) of a Markov chain (3.8), t = 1 ... horizon."""
    _check(log_observed, horizon)
    log_forward = np.empty((horizon, len(chain.initial)))
    with np.errstate(divide="ignore"):
        before, log_transitions = np.log(chain.initial), np.log(chain.transitions)
    for t in range(horizon):
        log_forward[t] = before + (log_observed[t] if t < len(log_observed) else 0.0)
        before = np.logaddexp.reduce(log_forward[t][:, None] + log_transitions, axis=0)
    return log_forward


def occupancy(dynamics: Dynamics, log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
    """p(state i at step t | what was observed up to t); rows sum to one.

    Within the observed prefix this is filtering (3.38), beyond it prediction (3.41). With no observation
    (S = 0) it is the skill's own expectation.
    Raises: InvalidInput, when a log-probability is not finite or the model has no dynamics.
    """
    if isinstance(dynamics, Weights):
        raise InvalidInput(
            "a mixture has no order in time, so no occupancy; learn a Markov or semi-Markov skill"
        )
    _check(log_observed, horizon)
    log_observed = log_observed - log_observed.max(axis=1, keepdims=True, initial=-np.inf)  # rows sum to one
    if isinstance(dynamics, SemiMarkovChain):
        log_p = semi_markov_forward(dynamics, log_observed, horizon).log_occupancy
    else:
        log_p = markov_forward(dynamics, log_observed, horizon)
    return np.asarray(np.exp(log_p - np.logaddexp.reduce(log_p, axis=1)[:, None]))


def _check(log_observed: Float[Array, "S K"], horizon: int) -> None:
    require_kind("horizon", horizon, (int, np.integer), "give a whole number of steps")
    if horizon < max(1, len(log_observed)):
        raise InvalidInput(
            f"horizon is {horizon} steps, expected at least 1, and the {len(log_observed)} observed ones"
        )
    if not np.isfinite(log_observed).all():
        t, i = np.argwhere(~np.isfinite(log_observed))[0]
        raise InvalidInput(
            f"log p of observation {t} in state {i} is {log_observed[t, i]}, expected a finite number; check "
            "that start and frames are finite and in the units of the demonstrations"
        )
