"""The compiled kernels, for the newest instruction set that this processor has. Twins say what they compute.

Importing this module raises ImportError where they could not be built.
"""

from importlib import import_module
from typing import Any

import numpy as np

from pilotfish.kernels import twins
from pilotfish.kernels.arguments import Emissions
from pilotfish.kernels.refusals import flat_row, free_push, singular_transform
from pilotfish.kernels.results import EStep, ForwardBackward, Riccati, Viterbi
from pilotfish.kernels.twins.chain import log_or_never
from pilotfish.kernels.twins.expectation import semi_markov_e_step
from pilotfish.kernels.twins.semi_markov import semi_markov, semi_markov_viterbi
from pilotfish.types import Array, Float, Int

__all__ = [
    "LEVEL",
    "e_step",
    "forward_backward",
    "log_emissions",
    "riccati",
    "semi_markov",
    "semi_markov_e_step",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "viterbi",
]

_baseline: Any = import_module("pilotfish.kernels._baseline")
LEVEL: str = "x86-64-v3" if _baseline.supports_v3() else "baseline"
_native: Any = import_module("pilotfish.kernels._v3") if LEVEL == "x86-64-v3" else _baseline


def _packed(values: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """The same numbers as C-contiguous float64, copied only if they were not."""
    return np.ascontiguousarray(values, dtype=np.float64)


def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    if emissions.turns:
        return twins.log_emissions(x, emissions)
    log_densities: Float[Array, "N K"] = _native.log_emissions(
        _packed(x), _packed(emissions.means), _packed(emissions.whiteners)
    )
    return log_densities


def e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    initial: Float[Array, " K"],
    transitions: Float[Array, "K K"],
    emissions: Emissions,
    threads: int = 1,
) -> EStep:
    if emissions.turns:
        return twins.e_step(x, lengths, initial, transitions, emissions)
    sums = _native.e_step(
        _packed(x),
        np.ascontiguousarray(lengths, dtype=np.int64),
        _packed(log_or_never(initial)),
        _packed(transitions),
        _packed(log_or_never(transitions)),
        _packed(emissions.means),
        _packed(emissions.whiteners),
    )
    return EStep(*sums)


def forward_backward(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ForwardBackward:
    log_initial, log_transitions = _packed(log_or_never(initial)), _packed(log_or_never(transitions))
    emissions = _packed(log_emissions)
    return ForwardBackward(
        *_native.forward_backward(emissions, log_initial, _packed(transitions), log_transitions)
    )


def viterbi(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> Viterbi:
    log_initial, log_transitions = _packed(log_or_never(initial)), _packed(log_or_never(transitions))
    states, log_probability = _native.viterbi(_packed(log_emissions), log_initial, log_transitions)
    return Viterbi(states.view(np.int64), log_probability)  # the same bits, by the name that NumPy knows them


def riccati(
    A: Float[Array, "S n n"],
    B: Float[Array, "S n m"],
    weights: Float[Array, "T n n"],
    targets: Float[Array, "T n"],
    effort: Float[Array, "m m"],
) -> Riccati:
    refused, *solution = _native.riccati(
        _packed(A), _packed(B), _packed(weights), _packed(targets), _packed(effort)
    )
    if refused >= 0:
        raise free_push(refused)
    return Riccati(*solution)


def semi_tied_sweeps(
    scatters: Float[Array, "K D D"], mass: Float[Array, " K"], transform: Float[Array, "D D"], sweeps: int
) -> Float[Array, "D D"]:
    present = mass > 0.0
    improved: Float[Array, "D D"]
    refused, improved = _native.semi_tied_sweeps(
        _packed(scatters[present]), _packed(mass[present]), _packed(transform), sweeps
    )
    if refused == len(transform):
        raise singular_transform()
    if refused >= 0:
        raise flat_row(refused)
    return improved
